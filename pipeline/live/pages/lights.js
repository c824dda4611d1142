// Lights: each a lamp of its own shape and sign, a name and one sentence. They change five times a second, so that list is
// not read out; what turns amber or red is said once.

import { filled } from "./texts.js";

const SIGNS = { green: "✓", amber: "!", red: "✕", off: "–" };

function row(name) {
  const item = document.createElement("li");
  const parts = ["lamp", "name", "words"].map((className) => Object.assign(document.createElement("span"), { className }));
  parts[0].setAttribute("role", "img");
  parts[1].textContent = name;
  item.append(...parts);
  return item;
}

function show(item, texts, { light, text }) {
  const [lamp, , words] = item.children;
  lamp.className = `lamp ${light}`;
  lamp.textContent = SIGNS[light];
  lamp.setAttribute("aria-label", texts.light[light]);
  words.textContent = text;
}

// Show `lights` = [{ id, name, light, text }] in a list, row for row; rows that stay are kept, so that nothing flickers.
export function showLights(list, texts, lights) {
  const rows = new Map([...list.children].map((item) => [item.dataset.id, item]));
  const shown = lights.map((one) => {
    const item = rows.get(one.id) ?? row(one.name);
    item.dataset.id = one.id;
    show(item, texts, one);
    return item;
  });
  if (shown.some((item, i) => list.children[i] !== item) || list.children.length !== shown.length) list.replaceChildren(...shown);
}

// A function that says in `place` which lights got worse since its last call, and takes that away once it is no longer so.
export function announcer(place, texts) {
  const before = new Map();
  let said = new Map();
  return (lights) => {
    const worse = lights.filter((one) => ["amber", "red"].includes(one.light) && before.get(one.id) !== one.light);
    for (const one of lights) before.set(one.id, one.light);
    if (worse.length) {
      said = new Map(worse.map((one) => [one.id, one.light]));
      place.textContent = worse.map((one) => filled(texts.changed, { ...one, light: texts.light[one.light] })).join(" ");
    } else if ([...said].some(([id, light]) => before.get(id) !== light)) {
      said.clear();
      place.textContent = "";
    }
  };
}
