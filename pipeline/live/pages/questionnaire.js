// The questionnaire's page. Every answer goes to the server when it is given, and the page goes on only when all of its
// answers are saved there; so a page that is closed, reloaded or opened elsewhere goes on where it was.

import { makeScale } from "./scale.js";
import { Link } from "./socket.js";
import { fill, filled, loadTexts, taskName } from "./texts.js";

const texts = await loadTexts("questionnaire");
const at = (id) => document.getElementById(id);

let form = null; // the server's last `form`
let words = null; // its title, items and their words
let page = 0; // of `pages()`
let submitting = false;
const pending = new Map(); // id -> answer that is not known to be saved
let count = 0;
const run = crypto.getRandomValues(new Uint32Array(2)).join("-"); // ids of this page are of no other one

const link = new Link("questionnaire", {
  hello: () => ({ type: "hello", page: "questionnaire", version: 1, agent: navigator.userAgent }),
  receive,
  status: (name) => {
    at("connection").textContent = name === "open" ? "" : texts.common.connection[name];
    at("connection").hidden = name === "open";
  },
});

function receive(message) {
  if (message.type === "form") return takeForm(message);
  if (message.type === "state") return showWords(message.state);
  if (message.type === "saved") return saved(message.id);
  if (message.type === "refused") return refused(message);
  return null;
}

// ── What there is to fill in

function takeForm(message) {
  if (isOnThePage(message)) {
    // After a break of the connection: what was answered meanwhile stands on the page already, and is sent again.
    for (const answer of pending.values()) link.send(answer);
    return;
  }
  form = message;
  words = wordsOf(form);
  pending.clear();
  submitting = false;
  page = form.pairs.length && !missing(form.items).length ? 1 : 0;
  showPage();
}

// The same form with the same answers, save those that are under way. Another participant's looks alike, but is empty.
function isOnThePage({ questionnaire, task, items, pairs }) {
  if (form?.questionnaire !== questionnaire || form.task !== task) return false;
  const underWay = new Set([...pending.values()].map((message) => message.item));
  const here = new Map([...form.items, ...form.pairs].map((one) => [one.id, one.value]));
  return [...items, ...pairs].every(({ id, value }) => underWay.has(id) || (here.get(id) ?? null) === (value ?? null));
}

// The words of a built-in questionnaire are the page's own, in its language; those of a lab's own one come with it.
function wordsOf({ questionnaire, title, items }) {
  const own = texts.forms[questionnaire];
  const ofItem = (item) => own?.items[item.id] ?? { title: null, text: item.text, low: item.low, high: item.high };
  return { title: (own?.title ?? title) || texts.title, items: Object.fromEntries(items.map((item) => [item.id, ofItem(item)])) };
}

const pages = () => [form.items, form.pairs].filter((part) => part.length);
const missing = (part) => part.filter((one) => one.value === null || one.value === undefined);

function showWords(state) {
  form = null;
  at("form").hidden = at("keys").hidden = true;
  at("task").textContent = "";
  at("title").textContent = texts.title;
  at("words").textContent = texts.state[state];
}

function showPage() {
  const isPairs = pages()[page] === form.pairs;
  const task = taskName(texts, form.task);
  const place = form.of > 1 ? filled(texts.page, form) : "";
  at("task").textContent = [task, place].filter(Boolean).join(" · ");
  at("title").textContent = words.title;
  at("words").textContent = isPairs ? texts.pairs_intro : texts.intro;
  at("items").replaceChildren(...(isPairs ? form.pairs.map(pairBlock) : form.items.map(itemBlock)));
  at("next").textContent = page < pages().length - 1 ? texts.next : texts.submit;
  at("back").hidden = page === 0;
  at("missing").hidden = true;
  at("form").hidden = false;
  at("keys").hidden = isPairs;
  showSaving();
}

function itemBlock(item) {
  const { title, text, definition, low, high } = words.items[item.id];
  const block = element("section", "item");
  block.append(element("h2", "", title ?? text));
  if (title) block.append(element("p", "", text));
  const scale = makeScale(item, { name: title ?? text, low, high, unanswered: texts.unanswered, mark: texts.mark }, (value) => {
    item.value = value;
    answer(item.id, value);
  });
  const ends = element("p", "ends");
  ends.append(element("span", "", low), element("span", "", high));
  block.append(scale.strip, ends);
  if (definition) {
    const more = element("details", "");
    more.append(element("summary", "", texts.more), element("p", "", definition));
    block.append(more);
  }
  return block;
}

function pairBlock(pair) {
  const names = [pair.first, pair.second].map((id) => words.items[id].title);
  const block = element("fieldset", "pair");
  block.append(element("legend", "unseen", filled(texts.pair, { first: names[0], second: names[1] })));
  names.forEach((name, value) => {
    const radio = Object.assign(element("input"), { type: "radio", name: pair.id, checked: pair.value === value });
    if (value === 0) radio.id = `item-${pair.id}`;
    radio.addEventListener("change", () => {
      pair.value = value;
      answer(pair.id, value);
    });
    const label = element("label", "");
    label.append(radio, element("span", "", name));
    block.append(label);
  });
  return block;
}

function element(tag, className = "", text = "") {
  return Object.assign(document.createElement(tag), { className, textContent: text });
}

// ── Saving

function send(message) {
  const id = `${run}-${(count += 1)}`;
  const whole = { ...message, questionnaire: form.questionnaire, id };
  pending.set(id, whole);
  link.send(whole); // where there is no connection it goes when there is one again
  showSaving();
}

function answer(item, value) {
  // An older answer to the same item that is not saved yet must not come after this one.
  for (const [id, other] of pending) if (other.item === item) pending.delete(id);
  at("missing").hidden = true;
  send({ type: "answer", item, value });
}

function saved(id) {
  const message = pending.get(id);
  pending.delete(id);
  showSaving();
  if (message?.type !== "submit" && submitting && !pending.size) goOn();
}

function refused({ id, why }) {
  pending.delete(id);
  submitting = false;
  say(filled(texts.refused, { why }));
  showSaving();
}

function showSaving() {
  const given = form && [...form.items, ...form.pairs].length > missing([...form.items, ...form.pairs]).length;
  at("saving").textContent = pending.size ? texts.saving : given ? texts.saved : "";
}

function say(text) {
  at("missing").textContent = text;
  at("missing").hidden = false;
}

// ── Going on and back

at("form").addEventListener("submit", (event) => {
  event.preventDefault();
  const without = missing(pages()[page]);
  if (without.length) {
    const name = (one) => words.items[one.id]?.title ?? words.items[one.id]?.text ?? pairName(one);
    say(filled(texts.missing, { items: without.map(name).join(", ") }));
    at(`item-${without[0].id}`).focus();
    return;
  }
  submitting = true;
  if (!pending.size) goOn();
});

function pairName({ first, second }) {
  return filled(texts.pair, { first: words.items[first].title, second: words.items[second].title }).replace(/\?$/, "");
}

function goOn() {
  submitting = false;
  if (page === pages().length - 1) return send({ type: "submit" });
  page += 1;
  return turned();
}

at("back").addEventListener("click", () => {
  page -= 1;
  submitting = false;
  turned();
});

function turned() {
  showPage();
  at("title").focus({ preventScroll: true });
  scrollTo(0, 0);
}

fill(document, texts);
showWords("waiting");
