// Plays a session: the clock, the controls and the strip of distances above the time line.
//
// Nothing moves before somebody presses Play. traces.js opens sessions and calls `openPlayer`; its `state.lines` are shared.

const SPEEDS = [0.25, 0.5, 1, 2, 4, 8];
const STRIP_STEP_S = 1 / 30; // of the distances in the strip
const STRIP_TOP = 20; // px, below its words
const player = { played: null, instant: 0, from: 0, to: 1, speed: 1, playing: false, before: null, strip: null };

function startPlayer() {
  const texts = SPEEDS.map((speed) => ({ 0.25: "\u00bc", 0.5: "\u00bd" }[speed] ?? speed) + "\u00d7");
  options(at("speed"), texts);
  setSpeed(1);
  at("speed").addEventListener("change", (event) => setSpeed(SPEEDS[event.target.value]));
  at("play").addEventListener("click", togglePlaying);
  at("still").addEventListener("click", saveStill);
  at("time").addEventListener("input", (event) => seek(Number(event.target.value)));
  at("compared").addEventListener("change", (event) => compareWith(Number(event.target.value)));
  at("player").addEventListener("keydown", playerKey);
  followTimeLine(at("strip"));
  new ResizeObserver(() => { player.strip = null; show(); }).observe(at("stage"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { player.strip = null; show(); });
}

function openPlayer(session, lines, whole) {
  player.played = null;
  pause();
  const scene = session.scene, usable = (line) => scene.plane.every((axis) => line.values[axis]) && line.n > 0;
  at("player").hidden = !scene || !lines.some(usable);
  if (at("player").hidden) return;
  const named = (name) => lines.find((line) => line.name === name && usable(line)) ?? null;
  const chosen = { hand: lines.find((line) => line.kind === "reference" && usable(line)) ?? null, displayed: named(scene.displayed), compared: named(scene.compared) };
  player.played = { scene, lines: chosen, bounds: boundsOf(scene, chosen), route: routeOf(scene, chosen) };
  player.choices = lines.filter((line) => line.kind === "estimator" && usable(line));
  options(at("compared"), player.choices.map((line) => line.name));
  at("compared").value = player.choices.indexOf(chosen.compared);
  [player.from, player.to] = whole;
  player.strip = null;
  Object.assign(at("time"), { min: player.from, max: player.to, step: 0.001 });
  at("events-left-out").textContent = scene.events_left_out ? `${scene.events_left_out} later events are left out of this page.` : "";
  seek(firstMoment(player.played, whole[0]));
}

// The first moment at which there is something to see.
function firstMoment(played, begin) {
  const first = Object.values(played.lines).filter(Boolean).map((line) => line.time[0]);
  return Math.max(begin, ...first);
}

function compareWith(index) {
  player.played.lines.compared = player.choices[index] ?? null;
  player.strip = null;
  show();
}

function setSpeed(speed) {
  player.speed = speed;
  at("speed").value = SPEEDS.indexOf(speed);
}

function togglePlaying() { if (player.playing) pause(); else play(); }

function play() {
  if (!player.played) return;
  if (player.instant >= player.to) player.instant = player.from;
  Object.assign(player, { playing: true, before: null });
  at("play").textContent = "Pause";
  requestAnimationFrame(advance);
}

function pause() {
  player.playing = false;
  at("play").textContent = "Play";
  if (player.played) { state.instant = player.instant; draw(); }
}

function advance(now) {
  if (!player.playing) return;
  const passed = player.before === null ? 0 : Math.min((now - player.before) / 1000, 0.25); // a hidden tab does not jump
  player.before = now;
  seek(player.instant + passed * player.speed);
  if (player.instant >= player.to) pause(); else requestAnimationFrame(advance);
}

function seek(instant) {
  player.instant = Math.min(Math.max(instant, player.from), player.to);
  show();
}

function show() {
  if (!player.played) return;
  const colours = look();
  const [context, width, height] = fresh(at("stage"));
  paint(context, moment(player.played, player.instant, width, height, colours));
  showStrip(colours);
  const seconds = `${player.instant.toFixed(2)} of ${player.to.toFixed(2)} s`;
  at("time").value = player.instant;
  at("time").setAttribute("aria-valuetext", seconds);
  at("clock").textContent = seconds;
}

function paperColour() { return getComputedStyle(document.documentElement).getPropertyValue("--paper").trim(); }

// A canvas cleared, in pixels of the page whatever the screen's are.
function fresh(canvas) {
  const dots = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  const [across, down] = [Math.round(width * dots), Math.round(height * dots)];
  if (canvas.width !== across || canvas.height !== down) Object.assign(canvas, { width: across, height: down });
  const context = canvas.getContext("2d");
  context.setTransform(dots, 0, 0, dots, 0, 0);
  context.clearRect(0, 0, width, height);
  return [context, width, height];
}

// The strip is drawn once into a canvas of its own; only the mark of the moment moves.
function showStrip(colours) {
  const [context, width, height] = fresh(at("strip"));
  player.strip ??= stripPicture(width, height, colours);
  context.drawImage(player.strip, 0, 0, width, height);
  const x = stripX(player.instant, width);
  paint(context, [{ type: "line", points: [[x, STRIP_TOP], [x, height]], colour: colours.ink, stroke: 2 }]);
}

function stripPicture(width, height, colours) {
  const canvas = document.createElement("canvas"), dots = window.devicePixelRatio || 1;
  Object.assign(canvas, { width: Math.max(1, width * dots), height: Math.max(1, height * dots) });
  const context = canvas.getContext("2d");
  context.scale(dots, dots);
  paint(context, stripShapes(player.played, width, height, colours));
  return canvas;
}

function stripX(instant, width) { return 8 + (instant - player.from) / (player.to - player.from) * (width - 16); }

function stripShapes(played, width, height, colours) {
  const roles = ["displayed", "compared"].filter((role) => played.lines[role] && played.lines.hand);
  const distances = Object.fromEntries(roles.map((role) => [role, distancesFromHand(played, role)]));
  const usual = Object.values(distances).flat().map(([, off]) => off).filter((off) => !isNaN(off)).sort((a, b) => a - b);
  const highest = usual[Math.floor(0.995 * usual.length)] || 1, top = STRIP_TOP;
  const shapes = roles.map((role) => ({ type: "line", colour: roleColour(role, colours), stroke: 1.1,
    points: distances[role].filter(([, off]) => !isNaN(off)).map(([time, off]) => [stripX(time, width), height - Math.min(off / highest, 1) * (height - top)]) }));
  for (const event of played.scene.events.filter((one) => one.type === "selection")) {
    const x = stripX(event.time, width);
    shapes.push({ type: "line", points: [[x, top], [x, height]], colour: colours.soft, dash: [2, 3] });
  }
  const text = roles.length ? `Distance from the hand, up to ${highest.toFixed(0)}\u202fmm` : "Time";
  return [...shapes, { type: "text", x: 8, y: 13, text: text + (played.scene.events.length ? "; dotted: selections" : ""), colour: colours.soft }];
}

function distancesFromHand(played, role) {
  const { plane } = played.scene, { hand } = played.lines, line = played.lines[role], found = [];
  for (let time = player.from; time <= player.to; time += Math.max(STRIP_STEP_S, (player.to - player.from) / 6000)) {
    found.push([time, distance(placeAt(line, plane, time), placeAt(hand, plane, time))]);
  }
  return found;
}

function followTimeLine(strip) {
  const follow = (event) => {
    const box = strip.getBoundingClientRect();
    seek(player.from + (event.clientX - box.left - 8) / (box.width - 16) * (player.to - player.from));
  };
  strip.addEventListener("pointerdown", (event) => { strip.setPointerCapture(event.pointerId); follow(event); });
  strip.addEventListener("pointermove", (event) => { if (strip.hasPointerCapture(event.pointerId)) follow(event); });
}

const PLAYER_KEYS = {
  " ": togglePlaying, ArrowLeft: (far) => seek(player.instant - (far ? 5 : 0.1)), ArrowRight: (far) => seek(player.instant + (far ? 5 : 0.1)),
  Home: () => seek(player.from), End: () => seek(player.to), "+": () => faster(1), "-": () => faster(-1), s: saveStill,
};

function faster(steps) { setSpeed(SPEEDS[Math.min(Math.max(SPEEDS.indexOf(player.speed) + steps, 0), SPEEDS.length - 1)]); }

// A list keeps its keys, and a button its space bar.
function playerKey(event) {
  const own = event.target.tagName === "SELECT" || (event.target.tagName === "BUTTON" && event.key === " ");
  const act = PLAYER_KEYS[event.key];
  if (!act || own || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  act(event.shiftKey);
}

function still() {
  const stage = at("stage"), [width, height] = [stage.clientWidth, stage.clientHeight], session = sessions[state.index];
  const colours = { ...look(), paper: paperColour() };
  const shapes = [{ type: "rect", x: 0, y: 0, width, height: height + 24, fill: colours.paper }, ...moment(player.played, player.instant, width, height, colours)];
  const title = `${session.session}, ${player.instant.toFixed(2)} s`;
  shapes.push({ type: "text", x: 8, y: height + 17, text: `${title}. ${at("origin").textContent}`, colour: colours.soft });
  return svgOf(shapes, width, height + 24, title);
}

function saveStill() {
  const link = document.createElement("a"), plain = sessions[state.index].session.replace(/[^A-Za-z0-9-]+/g, "-");
  link.href = URL.createObjectURL(new Blob([still()], { type: "image/svg+xml" }));
  link.download = `${plain}-${player.instant.toFixed(2)}s.svg`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
