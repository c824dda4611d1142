// The operator's page: shows the state that the recorder sends whole after each change, and asks it to do things. It
// decides nothing itself: which button there is, whether a check may be passed over, and what is refused is the recorder's.

import { exchangeKey } from "./key.js";
import { announcer, showLights } from "./lights.js";
import { showOffers } from "./offers.js";
import { showParticipants, showSheet } from "./participants.js";
import { Link } from "./socket.js";
import { fill, filled, loadTexts, taskName } from "./texts.js";
import { drawTraces } from "./traces.js";

const NEEDS_REASON = new Set(["abort", "redo", "skip", "drop"]);
const GOES_WITHOUT = "questionnaire"; // the phase in which `next` leaves answers missing, which nobody should do by a slip

const texts = await loadTexts("operator");
const at = (id) => document.getElementById(id);
const announce = announcer(at("changed"), texts);
let state = null;
let stateAt = 0;
let count = 0;
const asked = new Map(); // id -> { what, text }, not answered yet

fill(document, texts);
if (location.hash) await exchangeKey();
const link = new Link("operator", {
  hello: () => ({ type: "hello", page: "operator", version: 1, agent: navigator.userAgent }),
  receive,
  status: (name) => {
    at("connection").textContent = name === "open" ? "" : texts.common.connection[name];
    at("connection").hidden = name === "open";
    if (name !== "open") asked.clear(); // what was under way may have been done or not: the state will tell
    if (state) showButtons();
  },
});

function receive(message) {
  const { type } = message;
  if (type === "state") return showState(message);
  if (type === "lights") return showWatch(message);
  if (type === "done" || type === "refused") return answered(message);
  return null;
}

// ── The state

function showState(message) {
  state = message;
  stateAt = performance.now();
  at("study").textContent = state.study;
  at("demo").hidden = !state.demo;
  at("read-only").hidden = !state.read_only;
  showNow();
  showButtons();
  showProblems();
  at("checks").hidden = !state.checks.length;
  showLights(at("check-list"), texts, state.checks.map((check) => ({ ...check, name: texts.check[check.id] ?? check.id })));
  showParticipants(at("participants"), texts, state.participants);
  showSheet(at("sheet-table"), texts, state.participants);
  showLinks();
}

function showNow() {
  const { now, phase, agreement } = state;
  at("phase").textContent = texts.phase[phase];
  at("who").textContent = now ? filled(texts.who, { participant: now.participant, task: taskName(texts, `${now.task}`) }) : "";
  showClock();
  at("agreement").hidden = !agreement;
  if (agreement) at("agreement").textContent = filled(texts.agreement, { mm: power(agreement.mm), n: agreement.n });
}

// The state comes with each change only, so the seconds since then are counted here.
function showClock() {
  at("clock").textContent = state?.now ? clock(state.now, (performance.now() - stateAt) / 1000) : "";
}

function clock({ trial, seconds, seconds_left: left }, since) {
  if (state.phase === "countdown" && Number.isFinite(left)) {
    return filled(texts.countdown, { seconds: Math.max(0, Math.ceil(left - since)) });
  }
  const running = state.phase === "running";
  return trial ? filled(texts.trial, { trial, seconds: Math.floor(seconds + (running ? since : 0)) }) : "";
}

setInterval(showClock, 200);

// 1.2e-12 as 1.2·10⁻¹²
function power(value) {
  const [digits, exponent] = value.toExponential(1).split("e");
  const raised = [...exponent.replace("+", "")].map((sign) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(sign)]).join("");
  return value === 0 || value >= 0.01 ? `${Number(value.toPrecision(3))}` : `${digits}·10${raised}`;
}

function showProblems() {
  at("problems").hidden = !state.problems.length;
  at("problems").replaceChildren(...state.problems.map((text) => element("li", text)));
}

function showLinks() {
  at("pages").textContent = filled(texts.pages, { phones: state.phones, questionnaires: state.questionnaires_open });
  const links = state.links ?? [];
  const wanted = JSON.stringify(links);
  if (at("links").dataset.shown === wanted) return; // the codes are not fetched anew with each state
  at("links").dataset.shown = wanted;
  at("links").replaceChildren(...links.map(({ role, url, qr }) => {
    const item = element("li", "");
    const code = Object.assign(element("img", ""), { src: qr, alt: texts.link[role], width: 200, height: 200 });
    const link = Object.assign(element("a", url), { href: url, target: "_blank", rel: "noopener" }); // on this machine too
    item.append(element("p", texts.link[role]), code, link);
    return item;
  }));
}

function element(tag, text) {
  return Object.assign(document.createElement(tag), { textContent: text });
}

// ── What can be done

function showButtons() {
  const { next, read_only: readOnly } = state;
  const off = readOnly || !link?.open;
  at("big").textContent = next.do ? next.label : texts.nothing;
  at("big").disabled = off || !next.do;
  at("big").dataset.do = next.do ?? "";
  const others = next.others.filter((what) => what !== "note");
  const kept = [...at("others").children].map((button) => button.dataset.do).join();
  if (kept !== others.join()) at("others").replaceChildren(...others.map(otherButton));
  for (const button of [...at("others").children, ...at("note").querySelectorAll("button")]) button.disabled = off;
  at("offers").hidden = !state.offers.length;
  showOffers(at("offer-list"), texts.offers, state.offers, off, (id) => ask("accept", id));
}

function otherButton(what) {
  const button = Object.assign(element("button", texts.do[what]), { type: "button" });
  button.dataset.do = what;
  return button;
}

document.addEventListener("click", (event) => {
  const what = event.target.closest?.("button[data-do]")?.dataset.do;
  if (what) wish(what);
});

async function wish(what) {
  if ([...asked.values()].some((one) => one.what === what)) return; // a double click
  const red = what === "start" && state.checks.some(({ light }) => light === "red");
  const without = what === "next" && state.phase === GOES_WITHOUT;
  if (red || without || NEEDS_REASON.has(what)) await askWithReason(what, "");
  else ask(what, "");
}

async function askWithReason(what, why) {
  const text = await reason(what, why);
  if (text !== null) ask(what, text);
}

function ask(what, text) {
  const id = `d${Date.now().toString(36)}-${(count += 1)}`;
  asked.set(id, { what, text });
  at("answer").textContent = link.send({ type: "do", what, text, id }) ? "" : texts.common.connection.lost;
}

function answered({ type, id, why, reason_overrules: overrules }) {
  const { what, text } = asked.get(id) ?? {};
  asked.delete(id);
  at("answer").textContent = type === "refused" ? filled(texts.refused, { why }) : what === "note" ? texts.noted : what === "accept" ? texts.offers.accepted : "";
  if (type === "refused" && overrules && !text) askWithReason(what, why);
}

// A typed reason; null where it was thought better of.
function reason(what, why) {
  const dialog = at("reason");
  const name = what === state.next.do ? state.next.label : texts.do[what];
  at("reason-title").textContent = filled(texts.reason.title, { what: name });
  at("reason-do").textContent = texts.do[what];
  at("reason-why").textContent = why;
  at("reason-text").value = "";
  at("reason-missing").hidden = true;
  dialog.returnValue = "";
  dialog.showModal();
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => resolve(dialog.returnValue || null), { once: true });
  });
}

at("reason").querySelector("form").addEventListener("submit", (event) => {
  event.preventDefault();
  const text = at("reason-text").value.trim();
  at("reason-missing").hidden = Boolean(text);
  if (text) at("reason").close(text);
  else at("reason-text").focus();
});
at("reason-cancel").addEventListener("click", () => at("reason").close(""));

at("note").addEventListener("submit", (event) => {
  event.preventDefault();
  const text = at("note-text").value.trim();
  if (text) ask("note", text);
  at("note-text").value = "";
});

document.addEventListener("keydown", (event) => {
  const typing = event.target.closest?.("input, dialog") || event.ctrlKey || event.metaKey || event.altKey;
  if (typing || event.key.toLowerCase() !== "n") return;
  event.preventDefault();
  at("note-text").focus();
});

at("print").addEventListener("click", () => print());

// ── What is measured

function showWatch({ lights, drawn_hz, round_trip_ms, traces }) {
  const shown = Object.entries(lights).map(([id, { light, text }]) => ({ id, light, text, name: texts.light_name[id] ?? id }));
  showLights(at("light-list"), texts, shown);
  announce(shown);
  at("drawn-hz").textContent = figure(drawn_hz, texts.hz);
  at("round-trip").textContent = figure(round_trip_ms, texts.ms);
  if (traces) drawTraces(at("traces"), traces);
}

function figure(value, template) {
  return value === null || value === undefined ? texts.unknown : filled(template, { value: value.toFixed(1) });
}
