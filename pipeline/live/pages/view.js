// The phone's stage: how large the canvas is, where window, button and words lie on it, and its colours in light and dark.

import { pxPerMm } from "./calibrate.js";
import { draw, placed } from "./picture.js";
import { buttonSize } from "./press.js";

const BUTTON_MARGIN_PX = 16;
const BADGE_PX = 40; // the line at the top that says which task it is
const COLOURS = ["ink", "soft", "paper", "beyond", "path", "target"];

export class View {
  // `changed()` is called when the stage has another size, or other colours.
  constructor({ stage, picture, button, message }, changed) {
    Object.assign(this, { stage, picture, button, message });
    this.context = picture.getContext("2d");
    this.readLook();
    new ResizeObserver(changed).observe(stage);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.readLook();
      changed();
    });
  }

  readLook() {
    const style = getComputedStyle(document.documentElement);
    this.look = Object.fromEntries(COLOURS.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  }

  // Lay everything out for a task, with the button on a side. Nothing happens while the stage is not shown.
  fit(task, side) {
    const [width, height, ratio] = [this.stage.clientWidth, this.stage.clientHeight, devicePixelRatio];
    if (!width) return;
    Object.assign(this.picture, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const size = buttonSize(task.button.mm);
    const largest = task.window === "true_size" ? (pxPerMm() ?? Infinity) : Infinity;
    const box = placed(task, width, height, { side, room: size + BUTTON_MARGIN_PX, largest });
    Object.assign(this.button.style, { width: `${size}px`, height: `${size}px` });
    this.stage.classList.toggle("left", side === "left");
    this.box = box;
    this.placeMessage();
  }

  // In the middle of the window, or as far below as its words need: upright, the window is low and some sentences are long.
  placeMessage() {
    if (!this.box) return;
    const { left, top, width, height } = this.box;
    const highest = BADGE_PX + this.message.offsetHeight / 2;
    Object.assign(this.message.style, { left: `${left + width / 2}px`, top: `${Math.max(top + height / 2, highest)}px` });
  }

  // Whether there was a place to draw on.
  paint(task, estimate, target) {
    if (!this.box || this.stage.hidden) return false;
    this.context.clearRect(0, 0, this.picture.width, this.picture.height);
    draw(this.context, task, this.box, estimate, target, this.look);
    return true;
  }
}
