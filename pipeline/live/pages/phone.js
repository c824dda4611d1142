// The phone's page: it sends its motion, draws the newest estimate at each frame, and says which one was on the screen when
// the button was pressed. What task it is, what is a trial and what counts is the server's; it knows no condition's name.

import { calibrate, pxPerMm } from "./calibrate.js";
import { handAt } from "./picture.js";
import { listenToPresses } from "./press.js";
import { problems, showProblems } from "./problems.js";
import { askPermission, startMotion } from "./sensors.js";
import { clockMs, Link } from "./socket.js";
import { fill, filled, loadTexts, taskName } from "./texts.js";
import { View } from "./view.js";

const STALE_MS = 300; // without news: the picture is not to be trusted
const MOUSE_EVERY_MS = 1000 / 60;
const ACTIVE = new Set(["practice", "running"]);
const CHECKS = "checks"; // nothing is shown yet, and a press is how the way to the computer is timed

const texts = await loadTexts("phone");
const at = (id) => document.getElementById(id);
const [picture, button, stage] = ["picture", "select", "stage"].map(at);

const phone = {
  link: null,
  permission: "unavailable",
  wakeLock: null,
  battery: null,
  task: null, // the last `welcome`
  state: { state: "waiting" },
  estimate: null, // the last `show`
  drawnN: null, // the number of the estimate that is on the screen
  connection: "connecting",
  said: "",
  stale: false,
  problemsSeen: Boolean(sessionStorage.getItem("problems-seen")),
};

// ── Start: permission, wake lock, connection

const leftHanded = at("left-handed");
leftHanded.checked = localStorage.getItem("left-handed") === "yes";
leftHanded.addEventListener("change", () => localStorage.setItem("left-handed", leftHanded.checked ? "yes" : "no"));

async function start() {
  const asked = askPermission(); // first of all: a browser that asks does so only right after the tap
  fillScreen();
  phone.permission = await asked;
  await keepAwake();
  await begin(null);
}

// Where the browser can; it is as well without.
async function fillScreen() {
  try {
    await document.documentElement.requestFullscreen();
    await screen.orientation.lock("landscape");
  } catch {
    // iPhones have neither
  }
}

// After a reload nobody need tap again where the browser lets it be; a phone that is back at once goes on with its trial.
async function startAgain() {
  const before = sessionStorage.getItem("started");
  phone.permission = await askPermission();
  if (phone.permission === "denied" && before !== "denied") return showOnly("begin");
  await keepAwake();
  return begin(before);
}

// `before` is what the permission came to when this page was loaded first, so that a trial need not wait for readings.
async function begin(before) {
  showOnly("stage");
  show();
  if (["granted", "unneeded"].includes(phone.permission)) {
    const comes = startMotion((message) => phone.link?.sendReading(message));
    if (!before && !(await comes)) phone.permission = "unavailable";
  }
  phone.permission = before ?? phone.permission;
  sessionStorage.setItem("started", phone.permission);
  phone.link = new Link("phone", { hello, receive, status, pings: true });
  phone.battery = await navigator.getBattery?.().catch(() => null);
  phone.battery?.addEventListener("levelchange", sendBattery);
  sendBattery();
}

function hello() {
  return {
    type: "hello",
    page: "phone",
    version: 1,
    agent: navigator.userAgent,
    screen: { w: innerWidth, h: innerHeight, ratio: devicePixelRatio },
    permission: phone.permission,
    secure: isSecureContext,
    wake_lock: Boolean(phone.wakeLock),
    id: identity(),
  };
}

// The same after a reload or a break, so that a phone whose old connection only seems to live is not taken for a second one.
function identity() {
  const made = sessionStorage.getItem("id") ?? crypto.getRandomValues(new Uint32Array(3)).join("-");
  sessionStorage.setItem("id", made);
  return made;
}

async function keepAwake() {
  phone.wakeLock = (await navigator.wakeLock?.request("screen").catch(() => null)) ?? null;
}

document.addEventListener("visibilitychange", async () => {
  const visible = document.visibilityState === "visible";
  phone.link?.send({ type: "visible", visible, t: clockMs() });
  if (visible && phone.link) await keepAwake(); // the browser takes the lock away whenever the page is hidden
});

function sendBattery() {
  if (phone.battery) phone.link.send({ type: "battery", level: phone.battery.level });
}

// ── What has to be seen to before the picture: what the browser lacks, and how large a mm is where the window has its own

function showNext() {
  const found = phone.problemsSeen || phone.task.mouse ? [] : problems(phone);
  if (found.length) {
    showProblems(at("problem-list"), at("go-on"), found, texts);
    showOnly("problems");
  } else showOnly(phone.task.window === "true_size" && !pxPerMm() ? "calibration" : "stage");
}

at("start").addEventListener("click", start, { once: true }); // a second tap would connect twice
at("go-on").addEventListener("click", () => {
  phone.problemsSeen = true;
  sessionStorage.setItem("problems-seen", "yes");
  showNext();
});
calibrate({ card: at("card"), slider: at("card-size"), button: at("card-fits") }, showNext);
at("try-again").addEventListener("click", () => {
  sessionStorage.clear(); // a page loaded anew asks anew, within a tap
  location.reload();
});

function showOnly(id) {
  for (const part of ["begin", "problems", "calibration", "stage"]) at(part).hidden = part !== id;
  if (id === "stage") fit();
}

// ── From the server

function receive(message) {
  const { type } = message;
  if (type === "show") return takeEstimate(message);
  if (type === "welcome") takeTask(message);
  else if (type === "state") phone.state = message;
  else if (type === "say") phone.said = { wait: texts.wait }[message.what] ?? message.text;
  show();
  return requestDrawing();
}

function takeTask(message) {
  phone.task = message;
  showNext();
}

function status(name) {
  phone.connection = name;
  if (name === "open") sendBattery();
  else Object.assign(phone, { estimate: null, said: "" }); // what was known before a break is no news after it
  show();
}

let staleTimer = 0;
function takeEstimate(message) {
  phone.estimate = message;
  if (phone.stale || !staleTimer) setStale(false);
  clearTimeout(staleTimer);
  staleTimer = setTimeout(() => setStale(true), STALE_MS);
  requestDrawing();
}

function setStale(stale) {
  phone.stale = stale;
  show();
}

// ── Drawing: at most once a frame, and the newest only

let frame = 0;
function requestDrawing() {
  frame ||= requestAnimationFrame(() => {
    frame = 0;
    const painted = phone.task && phone.estimate && view.paint(phone.task, phone.estimate, phone.state.target);
    if (!painted || phone.drawnN === phone.estimate.n) return;
    const isFirst = phone.drawnN === null;
    phone.drawnN = phone.estimate.n;
    if (isFirst) show();
    phone.link.send({ type: "drawn", n: phone.drawnN, t: clockMs() }); // also says that no older one will be drawn
  });
}

function fit() {
  if (phone.task) view.fit(phone.task, side());
  requestDrawing();
}

function side() {
  const stated = phone.task.button.side;
  return leftHanded.checked ? { left: "right", right: "left" }[stated] : stated;
}

// ── Words and the button's state

function show() {
  const { state, target } = phone.state;
  const ready = phone.connection === "open" && ACTIVE.has(state);
  const waits = ready && phone.stale;
  stage.classList.toggle("stale", waits || phone.connection !== "open" || state === "paused");
  const checks = phone.connection === "open" && state === CHECKS;
  button.disabled = !checks && (!ready || waits || phone.drawnN === null);
  at("message").textContent = words(state, ready, waits);
  at("message").classList.toggle("count", state === "countdown");
  at("badge").textContent = phone.task ? badge(state, target) : "";
  view.placeMessage();
}

function words(state, ready, waits) {
  if (phone.connection !== "open") return texts.common.connection[phone.connection];
  if (phone.said) return phone.said;
  if (ready) return waits ? texts.wait : "";
  const seconds = phone.state.seconds_left;
  return state === "countdown" && seconds ? `${Math.ceil(seconds)}` : texts.state[state];
}

function badge(state, target) {
  const { task, of, targets_mm } = phone.task;
  const name = filled(texts.of, { task: taskName(texts, task), of });
  const practice = state === "practice" ? texts.state.practice : null;
  const place = ACTIVE.has(state) ? filled(texts.target, { number: target + 1, of: targets_mm.length }) : null;
  return [name, practice, place].filter(Boolean).join(" · ");
}

// ── Selecting, and the mouse as the hand

const presses = listenToPresses(button, {
  confirmMs: () => phone.task.confirm_ms ?? 150,
  begin: () => phone.drawnN,
  select: (n, { t, pressed_ms }) => phone.link.send({ type: "select", n: n ?? 0, t, pressed_ms }),
});

picture.addEventListener("pointerdown", (event) => {
  if (phone.task?.mouse && event.button === 0) presses.down(event);
});

// The last place before each sending, so that a mouse that stops is known where it stopped.
let moved = null;
stage.addEventListener("pointermove", (event) => {
  if (!phone.task?.mouse) return;
  if (!moved) setTimeout(sendMouse, MOUSE_EVERY_MS);
  moved = event;
});

function sendMouse() {
  const { left, top, width, height } = stage.getBoundingClientRect();
  const { x, y } = handAt(phone.task, width, height, moved.clientX - left, moved.clientY - top);
  phone.link.send({ type: "mouse", t: clockMs(moved.timeStamp), x, y });
  moved = null;
}

const view = new View({ stage, picture, button, message: at("message") }, fit);
fill(document, texts);
if (sessionStorage.getItem("started")) startAgain();
else showOnly("begin");
