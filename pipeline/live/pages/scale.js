// One line with marks, as on the paper form: no mark is set until the participant sets one, and no number is shown.
//
// A native range input carries the keyboard and what screen readers need. The pointer works on the whole strip around it:
// on a phone 21 marks are 16 px apart, so a finger is followed until it lets go, and some browsers would only let a knob
// be dragged that here is not there yet. A finger that turns out to scroll the page changes nothing.

import { filled } from "./texts.js";

const SVG = "http://www.w3.org/2000/svg";
const KEYS = new Set(["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "Home", "End", "PageUp", "PageDown", " ", "Enter"]);

// `words` = { name, low, high, unanswered, mark }; `answered(value)` is called when the participant has let go.
export function makeScale(item, words, answered) {
  const strip = document.createElement("div");
  strip.className = "scale";
  const range = Object.assign(document.createElement("input"), {
    type: "range", min: 0, max: item.steps, step: 1, id: `item-${item.id}`, value: Math.round(item.steps / 2),
  });
  range.setAttribute("aria-label", `${words.name}: ${words.low} – ${words.high}`);
  const line = document.createElement("div");
  line.className = "line";
  const mark = document.createElement("span");
  mark.className = "mark";
  line.append(ticks(item.steps), mark);
  strip.append(range, line);

  const state = { value: item.value ?? null };
  const show = (value) => {
    strip.classList.toggle("unanswered", value === null);
    if (value !== null) {
      range.value = value;
      mark.style.left = `${(100 * value) / item.steps}%`;
    }
    const spoken = value === null ? words.unanswered : filled(words.mark, { mark: value + 1, marks: item.steps + 1 });
    range.setAttribute("aria-valuetext", spoken);
  };
  const give = (value) => {
    const changed = value !== state.value;
    state.value = value;
    show(value);
    if (changed) answered(value);
  };
  show(state.value);
  followPointer(strip, line, item.steps, { show, give, reset: () => show(state.value) });
  followKeys(range, give);
  return { strip, range, state };
}

function followPointer(strip, line, steps, { show, give, reset }) {
  const at = (event) => {
    const { left, width } = line.getBoundingClientRect();
    return Math.round(steps * Math.min(1, Math.max(0, (event.clientX - left) / width)));
  };
  strip.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    strip.setPointerCapture(event.pointerId);
    show(at(event));
  });
  strip.addEventListener("pointermove", (event) => {
    if (strip.hasPointerCapture(event.pointerId)) show(at(event));
  });
  strip.addEventListener("pointerup", (event) => {
    if (strip.hasPointerCapture(event.pointerId)) give(at(event));
  });
  strip.addEventListener("pointercancel", reset);
}

// The first key sets the mark in the middle, which is where the range stands unseen; from there it moves.
function followKeys(range, give) {
  let pressed = false;
  range.addEventListener("keydown", (event) => {
    pressed = KEYS.has(event.key);
    if (event.key === "Enter") event.preventDefault(); // would send the form
  });
  range.addEventListener("input", () => give(Number(range.value)));
  range.addEventListener("keyup", () => {
    if (pressed) give(Number(range.value));
    pressed = false;
  });
}

function ticks(steps) {
  const svg = document.createElementNS(SVG, "svg");
  const draw = (x1, y1, x2, y2) => {
    const line = document.createElementNS(SVG, "line");
    Object.entries({ x1, y1, x2, y2 }).forEach(([name, value]) => line.setAttribute(name, value));
    svg.append(line);
  };
  svg.setAttribute("viewBox", `0 0 ${steps} 10`);
  svg.setAttribute("preserveAspectRatio", "none");
  svg.setAttribute("aria-hidden", "true");
  draw(0, 10, steps, 10);
  for (let step = 0; step <= steps; step++) draw(step, 2 * step === steps ? 0 : 4, step, 10);
  return svg;
}
