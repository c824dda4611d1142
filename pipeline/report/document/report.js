"use strict";
// Convenience only: without this script the page holds the same, in the order in which it was written.

function amount(text) {
  const told = text.includes("= ") ? text.split("= ")[1] : text;
  const plain = told.replace(/[\u2009\u202f]/g, "").replace(/\u2212/g, "-").replace(/^[<>+\[\s]+/, "");
  const found = plain.match(/^-?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?/);
  return found ? parseFloat(found[0]) : NaN;
}

function compared(first, second, numeric) {
  if (!numeric) return first.localeCompare(second, "en", { numeric: true });
  const [a, b] = [amount(first), amount(second)];
  if (isNaN(a) || isNaN(b)) return isNaN(a) - isNaN(b);
  return a - b;
}

function sorted(rows, column, numeric, sign) {
  const text = (row) => row.cells[column].textContent.trim();
  const known = (row) => text(row) !== "" && text(row) !== "\u2013" && !(numeric && isNaN(amount(text(row))));
  const order = (a, b) => (known(b) - known(a)) || (known(a) ? sign * compared(text(a), text(b), numeric) : 0);
  return sign ? [...rows].sort(order) : rows;
}

function makeSortable(table) {
  const headings = [...table.tHead.rows[0].cells];
  const rows = [...table.tBodies[0].rows];
  if (rows.length < 2) return;
  headings.forEach((heading, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.title = "Sort by this column: rising, falling, as it was";
    button.append(...heading.childNodes);
    heading.append(button);
    button.addEventListener("click", () => {
      const next = { ascending: "descending", descending: null }[heading.getAttribute("aria-sort")];
      const way = next === undefined ? "ascending" : next;
      headings.forEach((other) => other.removeAttribute("aria-sort"));
      table.classList.toggle("sorted", Boolean(way));
      if (way) heading.setAttribute("aria-sort", way);
      const sign = { ascending: 1, descending: -1 }[way] || 0;
      table.tBodies[0].append(...sorted(rows, column, heading.classList.contains("number"), sign));
    });
  });
}

// The words of a block without the links to rows of the report, which belong to no paper.
function wordsToPaste(block) {
  const copy = block.querySelector(".words").cloneNode(true);
  copy.querySelectorAll("a[href^='#']").forEach((link) => link.remove());
  const tidy = (text) => text.replace(/[ \n\t]+/g, " ").replace(/ ([,.;])/g, "$1").trim(); // keeps spaces of no break
  const texts = [...copy.querySelectorAll("p")].map((text) => tidy(text.textContent));
  return texts.join("\n\n");
}

// For browsers that let no page write to the clipboard by itself: what is selected can be copied by the user's click.
function copyBySelection(text) {
  const field = document.createElement("textarea");
  field.value = text;
  document.body.append(field);
  field.select();
  const done = document.execCommand("copy");
  field.remove();
  return done;
}

function makeCopyable(block) {
  const button = block.querySelector("button.copy");
  button.hidden = false;
  button.addEventListener("click", async () => {
    const text = wordsToPaste(block);
    let done = true;
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      done = copyBySelection(text);
    }
    button.textContent = done ? "Copied" : "Select the text and copy it";
    setTimeout(() => { button.textContent = "Copy"; }, 4000);
  });
}

function followSections(links) {
  const byId = new Map(links.map((link) => [link.hash.slice(1), link]));
  const seen = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (!entry.isIntersecting) continue;
      links.forEach((link) => link.removeAttribute("aria-current"));
      byId.get(entry.target.getAttribute("aria-labelledby"))?.setAttribute("aria-current", "true");
    }
  }, { rootMargin: "-5% 0px -85% 0px" });
  document.querySelectorAll("main > section").forEach((section) => seen.observe(section));
}

// Who a mark is: a browser shows its title where it is pointed at; a tap writes it below, as a finger points at nothing.
function tellNames(picture) {
  const line = document.createElement("p");
  line.className = "told-name";
  line.setAttribute("role", "status");
  picture.addEventListener("click", (event) => {
    const mark = event.target.closest("circle");
    picture.querySelectorAll(".told").forEach((other) => other.classList.remove("told"));
    line.textContent = mark ? mark.textContent : "";
    line.hidden = !mark;
    if (!mark) return;
    mark.classList.add("told");
    picture.after(line);
  });
}

document.querySelectorAll(".named").forEach(tellNames);
document.querySelectorAll("main table").forEach(makeSortable);
document.querySelectorAll(".paste").forEach(makeCopyable);
// A link may lead into what is folded away, which not every browser opens by itself.
function openAround(hash) {
  const target = hash && document.getElementById(decodeURIComponent(hash.slice(1)));
  const fold = target && target.closest("details:not([open])");
  if (!fold) return;
  fold.open = true;
  target.scrollIntoView();
}

// What is folded away is printed, and folded again afterwards.
let opened = [];
addEventListener("beforeprint", () => {
  opened = [...document.querySelectorAll("details:not([open])")];
  opened.forEach((one) => { one.open = true; });
});
addEventListener("afterprint", () => opened.splice(0).forEach((one) => { one.open = false; }));
addEventListener("hashchange", () => openAround(location.hash));
openAround(location.hash);
followSections([...document.querySelectorAll("#contents a")]);
