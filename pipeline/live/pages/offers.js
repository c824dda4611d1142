// Senders without a key that send and are not heard: each a sentence, and a button unless its stream has a sender already.
// The list comes anew each second; rows that stay are kept, so that a button keeps the focus.

import { filled } from "./texts.js";

const LONGEST = 64; // characters of an address from the network

function row(id, accept) {
  const item = document.createElement("li");
  const button = Object.assign(document.createElement("button"), { type: "button" });
  item.append(document.createElement("p"), button);
  item.dataset.id = id;
  button.addEventListener("click", () => accept(id));
  return item;
}

function show(item, texts, offer, off) {
  const [words, button] = item.children;
  const named = { ...offer, source: offer.source.slice(0, LONGEST), sends: offer.sends.slice(0, LONGEST) };
  words.textContent = filled(offer.accepted ? texts.taken : texts.free, named);
  button.textContent = filled(texts.accept, named);
  button.hidden = Boolean(offer.accepted);
  button.disabled = off;
}

// Show `offers` in a list; `accept` is called with the id of one when its button is pressed, unless all are `off`.
export function showOffers(list, texts, offers, off, accept) {
  const rows = new Map([...list.children].map((item) => [item.dataset.id, item]));
  const shown = offers.map((offer) => {
    const item = rows.get(offer.id) ?? row(offer.id, accept);
    show(item, texts, offer, off);
    return item;
  });
  if (shown.some((item, i) => list.children[i] !== item) || list.children.length !== shown.length) list.replaceChildren(...shown);
}
