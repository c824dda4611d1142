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

async function accessibilityFaults() {
  const standards = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"];
  const found = await axe.run(document, { runOnly: standards });
  return found.violations.filter((one) => ["serious", "critical"].includes(one.impact)).map((one) => {
    const where = one.nodes.slice(0, 2).map((node) => `${node.target.join(" ")} ${node.any[0]?.message ?? ""}`);
    return `axe: ${one.id}: ${one.help} (${where.join("; ")})`;
  });
}
