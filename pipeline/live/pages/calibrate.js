// How large a millimetre is on this screen: a browser does not know, so a bank card is held against it, once per device.

const CARD_MM = [85.6, 53.98]; // ISO/IEC 7810, ID-1
const KEPT = "px-per-mm";

// CSS px per mm of this screen; null where nobody has said it yet.
export function pxPerMm() {
  return Number(localStorage.getItem(KEPT)) || null;
}

// Let `card` grow and shrink with the slider; `done` when `button` is pressed. It lies on the side that is longer.
export function calibrate({ card, slider, button }, done) {
  const show = () => {
    const sides = CARD_MM.map((mm) => `${mm * Number(slider.value)}px`);
    const [width, height] = innerWidth > innerHeight ? sides : [...sides].reverse();
    Object.assign(card.style, { width, height });
  };
  slider.addEventListener("input", show);
  addEventListener("resize", show);
  button.addEventListener("click", () => {
    localStorage.setItem(KEPT, slider.value);
    done();
  });
  show();
}
