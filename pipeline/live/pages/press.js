// A press of the square button: by finger, mouse or key, felt and seen at once, whatever the server says and when.

import { clockMs } from "./socket.js";

const LONGEST_MS = 500; // a finger that rests on the button is not waited for: the task goes on with the selection
const PX_PER_MM = 160 / 25.4; // CSS px of a phone, which are about 1/160 inch
const SMALLEST_PX = 48;
const BUZZ_MS = 20;

export function buttonSize(mm) {
  return Math.max(SMALLEST_PX, mm * PX_PER_MM);
}

// `select({ t, pressed_ms })` for each press: `t` is the instant of touching, and how long it was held is only known on
// letting go, so it is called then. `begin()` is called at once, and what it returns is handed on: which estimate was on
// the screen at that instant.
export function listenToPresses(button, { confirmMs, begin, select }) {
  let press = null;

  const down = (event) => {
    if (button.disabled || press) return;
    press = { at: event.timeStamp, seen: begin(), late: setTimeout(() => up({ timeStamp: press.at + LONGEST_MS }), LONGEST_MS) };
    button.classList.add("pressed");
    setTimeout(() => button.classList.remove("pressed"), confirmMs());
    navigator.vibrate?.(BUZZ_MS);
  };
  const up = (event) => {
    if (!press) return;
    const { at, seen, late } = press;
    press = null;
    clearTimeout(late);
    select(seen, { t: clockMs(at), pressed_ms: Math.round(event.timeStamp - at) });
  };
  const isKey = (event) => event.key === " " || event.key === "Enter";

  button.addEventListener("pointerdown", (event) => {
    if (event.button === 0) down(event);
  });
  for (const name of ["pointerup", "pointercancel"]) addEventListener(name, up);
  addEventListener("keydown", (event) => {
    const isElsewhere = event.target.closest?.("button, input") && event.target !== button;
    if (!isKey(event) || button.disabled || isElsewhere) return;
    event.preventDefault(); // no second press by the click that a button makes of a key
    if (!event.repeat) down(event);
  });
  addEventListener("keyup", (event) => {
    if (isKey(event)) up(event);
  });
  return { down, up };
}
