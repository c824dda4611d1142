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
