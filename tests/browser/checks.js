// What the browser is asked of a page. Each answers with the faults it found, as text.
"use strict";

const settled = async (ready) => {
  for (let i = 0; i < 100 && !ready(); i++) await new Promise((done) => setTimeout(done, 20));
  return ready();
};

function overflowFaults() {
  const root = document.documentElement;
  if (root.scrollWidth <= root.clientWidth) return [];
  const wide = [...document.body.querySelectorAll("*")]
    .filter((one) => one.getBoundingClientRect().right > root.clientWidth + 1 && !one.closest(".scroll"))
    .slice(0, 3).map((one) => `${one.tagName}.${one.className}`);
  return [`the page is ${root.scrollWidth} px wide in a window of ${root.clientWidth}: ${wide.join(", ")}`];
}

// Every table stands in a part that scrolls; where it is wider, shadows at its edges and the keyboard lead to what is hidden.
function scrollFaults() {
  const faults = [], loose = [...document.querySelectorAll("main table")].filter((table) => !table.closest(".scroll"));
  if (loose.length) faults.push(`${loose.length} tables in no part that scrolls`);
  for (const part of document.querySelectorAll(".scroll")) {
    if (!part.clientWidth || part.scrollWidth <= part.clientWidth) continue; // folded away, or whole
    const style = getComputedStyle(part), name = part.getAttribute("aria-label");
    if (style.overflowX !== "auto" || part.tabIndex !== 0 || !name) faults.push(`${name}: hidden columns without a way to them`);
    if (!part.querySelector("img") && !style.backgroundImage.includes("gradient")) faults.push(`${name}: no edge says that it goes on`);
    part.scrollLeft = part.scrollWidth;
    const last = [...part.querySelectorAll("thead th")].pop(), edge = part.getBoundingClientRect().right;
    if (last && last.getBoundingClientRect().right > edge + 1) faults.push(`${name}: its last column is never seen`);
    part.scrollLeft = 0;
  }
  return faults;
}

// What is folded away opens by a link into it and for print, and is folded again afterwards.
async function foldFaults() {
  const folds = [...document.querySelectorAll("details.folded")], faults = [];
  if (!folds.length) return faults;
  if (folds.some((fold) => fold.open)) faults.push("folds: one is open before anybody asked");
  const inside = folds[0].querySelector("figure[id]");
  location.hash = inside.id;
  if (!(await settled(() => folds[0].open))) faults.push(`folds: a link to ${inside.id} does not open it`);
  folds[0].open = false;
  dispatchEvent(new Event("beforeprint"));
  if (!folds.every((fold) => fold.open)) faults.push("folds: not all are printed");
  dispatchEvent(new Event("afterprint"));
  if (folds.some((fold) => fold.open)) faults.push("folds: still open after print");
  folds[0].querySelector("summary").click();
  if (!folds[0].open) faults.push("folds: a click does not open one");
  folds[0].open = false;
  return faults;
}

// The button copies the words of its block without links to rows, and says so; where it may not, it says what to do.
// A mark that has a name lies where the picture shows it, and a tap on it says the name.
function nameFaults() {
  const faults = [];
  for (const picture of document.querySelectorAll(".named")) {
    const name = picture.closest("figure").id, image = picture.querySelector("img").getBoundingClientRect();
    const over = picture.querySelector("svg").getBoundingClientRect();
    if (image.width && Math.abs(image.width - over.width) > 1) faults.push(`${name}: names lie beside the marks`);
    const marks = [...picture.querySelectorAll("circle")], said = () => picture.parentElement.querySelector(".told-name");
    marks[0].dispatchEvent(new MouseEvent("click", { bubbles: true }));
    if (!said() || said().hidden || said().textContent !== marks[0].textContent.trim()) faults.push(`${name}: a tap says nothing`);
    picture.querySelector("img").click();
    if (!said().hidden || picture.querySelector(".told")) faults.push(`${name}: a name stays`);
  }
  return faults;
}

async function copyFaults() {
  const faults = [], given = Object.getOwnPropertyDescriptor(navigator, "clipboard");
  let copied = null, allowed = true;
  const writeText = async (text) => { if (!allowed) throw new Error("not allowed"); copied = text; };
  Object.defineProperty(navigator, "clipboard", { value: { writeText }, configurable: true });
  for (const block of document.querySelectorAll(".paste")) {
    const button = block.querySelector("button.copy"), name = block.getAttribute("aria-label");
    if (button.hidden) { faults.push(`copy, ${name}: no button`); continue; }
    [copied, allowed] = [null, true];
    button.click();
    if (!(await settled(() => button.textContent === "Copied"))) faults.push(`copy, ${name}: nothing is said`);
    const bare = (text) => text.replace(/\s/g, ""), first = bare(block.querySelector(".words p").textContent).slice(0, 10);
    if (!copied || !bare(copied).startsWith(first) || /\[row\]| [,.;]|  /.test(copied)) faults.push(`copy, ${name}: "${copied}"`);
    if (copied && copied.split("\n\n").length !== block.querySelectorAll(".words p").length) faults.push(`copy, ${name}: paragraphs are lost`);
    [allowed, button.textContent] = [false, "Copy"];
    button.click();
    if (!(await settled(() => button.textContent !== "Copy"))) faults.push(`copy, ${name}: a refusal is passed over`);
    if (document.querySelector("body > textarea")) faults.push(`copy, ${name}: its field stays`);
  }
  if (given) Object.defineProperty(navigator, "clipboard", given); else delete navigator.clipboard;
  return faults;
}

// Words of a page that lie over others: of each table's cells, and of headings and paragraphs beside one another.
function overprintFaults() {
  const faults = [], blocks = [...document.querySelectorAll("main h2, main p, main figcaption, main th, main td, main dt, main dd")];
  const hidden = (one) => one.closest("thead") && getComputedStyle(one.closest("thead")).clipPath !== "none"; // of cards
  const boxes = blocks.filter((one) => one.textContent.trim() && one.offsetParent && !hidden(one)).map((one) => {
    const range = document.createRange();
    range.selectNodeContents(one);
    return [one, range.getBoundingClientRect()];
  });
  boxes.forEach(([one, box], at) => {
    for (const [other, next] of boxes.slice(at + 1, at + 4)) {
      if (one.contains(other) || getComputedStyle(one).position === "sticky" || one.closest("details") !== other.closest("details")) continue;
      const [across, down] = [Math.min(box.right, next.right) - Math.max(box.left, next.left), Math.min(box.bottom, next.bottom) - Math.max(box.top, next.top)];
      if (across > 2 && down > 4) faults.push(`overprinted: "${one.textContent.slice(0, 20)}" and "${other.textContent.slice(0, 20)}"`);
    }
  });
  return faults.slice(0, 3);
}

function sortingFaults() {
  const table = [...document.querySelectorAll("main table")].find((one) => one.querySelector("thead .number button"));
  if (!table) return [];
  const heading = table.querySelector("thead .number"), button = heading.querySelector("button");
  const rows = () => [...table.tBodies[0].rows], order = rows();
  const amounts = () => rows().map((row) => amount(row.cells[heading.cellIndex].textContent)).filter((one) => !isNaN(one));
  const rises = (numbers) => numbers.every((value, i) => !i || value >= numbers[i - 1]);
  const faults = [];
  button.click();
  if (heading.getAttribute("aria-sort") !== "ascending" || !rises(amounts())) faults.push("sorting: not rising");
  button.click();
  if (heading.getAttribute("aria-sort") !== "descending" || !rises(amounts().reverse())) faults.push("sorting: not falling");
  button.click();
  if (heading.hasAttribute("aria-sort") || rows().some((row, i) => row !== order[i])) faults.push("sorting: not as it was");
  return faults;
}

async function tracesFaults() {
  if (!(await settled(() => state.lines.length))) return ["traces: nothing is unpacked"];
  const faults = [], whole = state.to - state.from, before = state.lines;
  document.getElementById("in").click();
  if (!(state.to - state.from < whole)) faults.push("traces: zooming in does nothing");
  picture.dispatchEvent(new KeyboardEvent("keydown", { key: "Home" }));
  if (state.to - state.from !== whole) faults.push("traces: Home does not show all");
  document.getElementById("next").click();
  if (!(await settled(() => state.lines !== before))) faults.push("traces: no other session opens");
  const pixels = picture.getContext("2d").getImageData(0, 0, picture.width, picture.height).data;
  if (!pixels.some((value) => value)) faults.push("traces: the picture is empty");
  return faults;
}

const asleep = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));

async function playerFaults() {
  if (!(await settled(() => state.lines.length))) return ["player: nothing is unpacked"];
  const playable = Boolean(sessions[state.index].scene); // nothing moves in a plane where there is one axis
  if (at("player").hidden === playable) return [playable ? "player: it is not there" : "player: it has nothing to play"];
  if (!playable) return [];
  const faults = [], key = (name, shiftKey = false) => at("stage").dispatchEvent(new KeyboardEvent("keydown", { key: name, shiftKey, bubbles: true }));
  const must = (holds, fault) => { if (!holds) faults.push(`player: ${fault}`); };
  must(!player.playing, "it plays before anybody asked");
  key("Home");
  must(player.instant === player.from, "Home does not go to the start");
  at("play").click();
  must(await settled(() => player.instant > player.from), "it does not play");
  key(" ");
  const paused = player.instant;
  await asleep(60);
  must(player.instant === paused, "space does not pause");
  key("Home"); key("ArrowRight"); key("ArrowRight"); key("ArrowLeft");
  must(Math.abs(player.instant - player.from - 0.1) < 1e-9, "the arrows do not move by 0.1 s");
  key("+");
  must(player.speed === 2 && at("speed").selectedOptions[0].textContent === "2\u00d7", "+ does not double the speed");
  key("-");
  key("End");
  must(player.instant === player.to, "End does not go to the end");
  dragFaults(must);
  faults.push(...stillFaults());
  return faults;
}

function dragFaults(must) {
  const middle = (player.from + player.to) / 2, box = at("strip").getBoundingClientRect();
  at("time").value = middle;
  at("time").dispatchEvent(new Event("input"));
  must(Math.abs(player.instant - middle) < 0.01, "the time line does not move it");
  const captured = at("strip").setPointerCapture;
  at("strip").setPointerCapture = () => {}; // a made-up pointer cannot be captured
  at("strip").dispatchEvent(new PointerEvent("pointerdown", { clientX: box.right - 8, clientY: box.top + 9 }));
  at("strip").setPointerCapture = captured;
  must(Math.abs(player.instant - player.to) < 0.02 * (player.to - player.from), "the strip does not move it");
  seek(middle);
}

// The still is XML, asks for nothing, and has every shape and word that the stage has at that moment.
function stillFaults() {
  const stage = at("stage"), faults = [], root = new DOMParser().parseFromString(still(), "image/svg+xml").documentElement;
  if (root.nodeName !== "svg" || root.querySelector("parsererror")) return ["still: not valid XML"];
  const flat = (shapes) => shapes.flatMap((shape) => shape.type === "group" ? flat(shape.shapes) : [shape]);
  const seen = flat(moment(player.played, player.instant, stage.clientWidth, stage.clientHeight, look()));
  for (const [type, tag] of [["line", "polyline"], ["circle", "circle"]]) {
    const [wanted, written] = [seen.filter((one) => one.type === type).length, root.querySelectorAll(tag).length];
    if (wanted !== written || !wanted) faults.push(`still: ${written} of ${wanted} ${tag}s`);
  }
  const words = [...root.querySelectorAll("text")].map((one) => one.textContent);
  for (const one of seen) if (one.type === "text" && !words.includes(withText(element("text", {}), one.text).textContent)) faults.push(`still: without "${one.text}"`);
  const pixels = stage.getContext("2d").getImageData(0, 0, stage.width, stage.height).data;
  if (!pixels.some((value) => value)) faults.push("player: the stage is empty");
  if (root.querySelector("script, image, a, foreignObject")) faults.push("still: holds more than shapes and words");
  return faults;
}

async function accessibilityFaults() {
  const standards = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"];
  const found = await axe.run(document, { runOnly: standards });
  return found.violations.filter((one) => ["serious", "critical"].includes(one.impact)).map((one) => {
    const where = one.nodes.slice(0, 2).map((node) => `${node.target.join(" ")} ${node.any[0]?.message ?? ""}`);
    return `axe: ${one.id}: ${one.help} (${where.join("; ")})`;
  });
}
