// Draws the sessions that are packed in #data. Every name is set as text.

const sessions = JSON.parse(document.getElementById("data").textContent);
const at = (id) => document.getElementById(id);
const picture = at("picture");
const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#b58900", "#7a5cc9", "#8c564b"];
const KINDS = { tracker: "tracker, as it arrived", estimator: "estimator", display: "displayed", reference: "reference" };
const state = { index: 0, lines: [], hidden: new Set(), axis: "", from: 0, to: 1, whole: [0, 1], instant: null };

async function inflated(text) {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function tenths(bytes, begin, n) {
  const values = new Float64Array(n);
  let sum = 0;
  for (let i = 0; i < n; i++) {
    let zigzag = 0;
    for (let plane = 0; plane < 4; plane++) zigzag |= bytes[begin + plane * n + i] << (8 * plane);
    sum = (sum + ((zigzag >>> 1) ^ -(zigzag & 1))) | 0;
    values[i] = sum / 10;
  }
  return values;
}

async function unpacked(session) {
  const bytes = await inflated(session.data);
  let begin = 0;
  const take = (n) => { const values = tenths(bytes, begin, n); begin += 4 * n; return values; };
  return session.series.map((series) => {
    const line = { ...series, key: series.kind + " " + series.name, values: {}, errors: {} };
    line.colour = COLOURS[series.place % COLOURS.length];
    line.time = take(series.n).map((milliseconds) => milliseconds / 1000);
    for (const axis of series.axes) line.values[axis] = take(series.n);
    return line;
  });
}

function last(times, instant) {
  let [low, high] = [0, times.length];
  while (low < high) { const middle = (low + high) >> 1; if (times[middle] <= instant) low = middle + 1; else high = middle; }
  return low - 1;
}

function between(line, axis, instant) {
  const values = line.values[axis], before = last(line.time, instant);
  if (!values || before < 0 || instant > line.time[line.n - 1]) return NaN;
  if (before === line.n - 1) return values[before];
  const share = (instant - line.time[before]) / (line.time[before + 1] - line.time[before]);
  return values[before] + share * (values[before + 1] - values[before]);
}

function errorsOf(line, axis) {
  const reference = state.lines.find((other) => other.kind === "reference");
  if (!reference || line === reference || !line.values[axis]) return null;
  line.errors[axis] ??= line.values[axis].map((value, i) => value - between(reference, axis, line.time[i]));
  return line.errors[axis];
}

function shown() { return state.lines.filter((line) => !state.hidden.has(line.key) && line.values[state.axis]); }

function inView(line) { return [Math.max(last(line.time, state.from), 0), Math.min(last(line.time, state.to) + 2, line.n)]; }

function range(pairs) {
  let [low, high] = [Infinity, -Infinity];
  for (const [line, values] of pairs) {
    const [begin, end] = inView(line);
    for (let i = begin; i < end; i++) { if (values[i] < low) low = values[i]; if (values[i] > high) high = values[i]; }
  }
  if (low > high) return [-1, 1];
  const room = Math.max((high - low) * 0.06, 0.5);
  return [low - room, high + room];
}

function ticks(low, high, count) {
  const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((times) => times * power).find((size) => size >= rough);
  const found = [];
  for (let i = Math.ceil(low / step); i * step <= high; i++) found.push(i * step);
  return [found, Math.max(0, -Math.floor(Math.log10(step) + 1e-9))];
}

function panel(context, box, title, pairs, look) {
  const [low, high] = range(pairs);
  const x = (time) => box.left + (time - state.from) / (state.to - state.from) * box.width;
  const y = (value) => box.top + (high - value) / (high - low) * box.height;
  context.font = `${FONT_PX}px ${FAMILY}`;
  context.lineWidth = 1;
  context.strokeStyle = look.line;
  context.fillStyle = look.soft;
  const minus = (number, digits) => number.toFixed(digits).replace("-", "\u2212");
  const [rows, rowDigits] = ticks(low, high, box.height / 45);
  context.textAlign = "right";
  for (const value of rows) {
    context.beginPath(); context.moveTo(box.left, y(value)); context.lineTo(box.left + box.width, y(value)); context.stroke();
    context.fillText(minus(value, rowDigits), box.left - 6, y(value) + 4);
  }
  const [columns, columnDigits] = ticks(state.from, state.to, box.width / 90);
  context.textAlign = "center";
  for (const time of columns) context.fillText(minus(time, columnDigits), x(time), box.top + box.height + 16);
  context.textAlign = "left";
  context.fillStyle = look.ink;
  context.fillText(title, box.left, box.top - 7);
  context.save();
  context.beginPath(); context.rect(box.left, box.top, box.width, box.height); context.clip();
  for (const [line, values] of pairs) stroke(context, line, values, x, y, look);
  if (state.instant !== null) {
    context.strokeStyle = look.soft; context.setLineDash([4, 4]);
    context.beginPath(); context.moveTo(x(state.instant), box.top); context.lineTo(x(state.instant), box.top + box.height); context.stroke();
    context.setLineDash([]);
  }
  context.restore();
}

function stroke(context, line, values, x, y, look) {
  const [begin, end] = inView(line);
  const dots = line.kind === "tracker";
  context.strokeStyle = context.fillStyle = colourOf(line, look);
  context.lineWidth = line.kind === "reference" ? 2 : 1.4;
  context.setLineDash(line.kind === "display" ? [6, 4] : []);
  context.beginPath();
  let pen = false;
  for (let i = begin; i < end; i++) {
    if (isNaN(values[i])) { pen = false; continue; }
    if (dots) context.rect(x(line.time[i]) - 1.5, y(values[i]) - 1.5, 3, 3);
    else if (pen) context.lineTo(x(line.time[i]), y(values[i]));
    else context.moveTo(x(line.time[i]), y(values[i]));
    pen = true;
  }
  if (dots) context.fill(); else context.stroke();
  context.setLineDash([]);
}

function colourOf(line, look) { return line.kind === "reference" ? look.ink : line.kind === "tracker" ? look.soft : line.colour; }

function look() {
  const style = getComputedStyle(document.documentElement);
  return Object.fromEntries(["ink", "soft", "line"].map((name) => [name, style.getPropertyValue("--" + name).trim()]));
}

function draw() {
  const dots = window.devicePixelRatio || 1, width = picture.clientWidth, height = picture.clientHeight;
  picture.width = Math.round(width * dots);
  picture.height = Math.round(height * dots);
  const context = picture.getContext("2d"), lines = shown(), colours = look();
  context.scale(dots, dots);
  const errors = lines.map((line) => [line, errorsOf(line, state.axis)]).filter(([, values]) => values);
  const inner = { left: 62, width: width - 72 };
  const share = errors.length ? 0.6 : 1, free = height - 24 - (errors.length ? 74 : 26);
  panel(context, { ...inner, top: 24, height: free * share }, "Position on " + state.axis + " (mm) over time (s)",
    lines.map((line) => [line, line.values[state.axis]]), colours);
  if (errors.length) {
    panel(context, { ...inner, top: 24 + free * share + 48, height: free * (1 - share) }, "Error on " + state.axis + " (mm)", errors, colours);
  }
  tell();
}

function tell() {
  const instant = state.instant ?? (state.from + state.to) / 2;
  at("instant").textContent = `At ${instant.toFixed(3)} s, axis ${state.axis}`;
  const number = (value) => isNaN(value) ? "\u2013" : value.toFixed(1).replace("-", "\u2212");
  const reference = state.lines.find((line) => line.kind === "reference");
  [...at("lines").rows].forEach((row, index) => {
    const line = state.lines[index], value = between(line, state.axis, instant);
    const truth = reference && line !== reference ? between(reference, state.axis, instant) : NaN;
    row.cells[2].textContent = number(value);
    row.cells[3].textContent = number(value - truth);
  });
  const session = sessions[state.index];
  picture.setAttribute("aria-label", `Traces of session ${session.session} on axis ${state.axis} from ${state.from.toFixed(2)} to `
    + `${state.to.toFixed(2)} s: ${shown().map((line) => line.name).join(", ")}. The table below has values.`);
}

function listLines() {
  at("lines").replaceChildren(...state.lines.map((line) => {
    const row = document.createElement("tr"), heading = document.createElement("th"), label = document.createElement("label");
    const box = document.createElement("input"), patch = document.createElement("canvas");
    box.type = "checkbox";
    box.checked = !state.hidden.has(line.key);
    box.addEventListener("change", () => { state.hidden[box.checked ? "delete" : "add"](line.key); draw(); });
    patch.width = 18; patch.height = 10; patch.setAttribute("aria-hidden", "true");
    const context = patch.getContext("2d");
    context.fillStyle = colourOf(line, look());
    context.fillRect(0, 3, 18, 4);
    heading.scope = "row";
    label.append(box, " ", patch, " ", line.name);
    heading.append(label);
    row.append(heading, ...["", "", ""].map((text, i) => Object.assign(document.createElement("td"), { className: i ? "number" : "" })));
    row.cells[1].textContent = KINDS[line.kind];
    return row;
  }));
}

function said(session) {
  const thinned = session.step_s ? `Thinned out to fit: of each line one reading in ${Number((1000 * session.step_s).toPrecision(3))} ms is kept; the logs have all. ` : "Every reading is here. ";
  const lost = session.left_out ? `${session.left_out} readings that are no numbers, or too large to draw, are left out. ` : "";
  return `${thinned}${lost}Values are rounded to 0.1 mm and 0.1 ms; between readings the table interpolates.`;
}

function options(select, texts) {
  select.replaceChildren(...texts.map((text, index) => Object.assign(document.createElement("option"), { value: index, textContent: text })));
}

async function open(index) {
  state.index = (index + sessions.length) % sessions.length;
  const session = sessions[state.index];
  at("session").value = state.index;
  state.lines = await unpacked(session);
  const times = state.lines.filter((line) => line.n).flatMap((line) => [line.time[0], line.time[line.n - 1]]);
  state.whole = times.length ? [Math.min(...times), Math.max(...times) + 1e-3] : [0, 1];
  [state.from, state.to] = state.whole;
  state.instant = null;
  const axes = [...new Set(state.lines.flatMap((line) => line.axes))];
  options(at("axis"), axes);
  if (!axes.includes(state.axis)) state.axis = liveliest(axes);
  at("axis").value = axes.indexOf(state.axis);
  at("said").textContent = said(session);
  listLines();
  draw();
  openPlayer(session, state.lines, state.whole);
}

function liveliest(axes) {
  const width = (axis) => Math.max(0, ...state.lines.filter((line) => line.values[axis] && line.n && line.kind !== "tracker").map((line) => {
    const [low, high] = range([[line, line.values[axis]]]);
    return high - low;
  }));
  return [...axes].sort((a, b) => width(b) - width(a))[0] || "x";
}

function view(from, to) {
  const [begin, end] = state.whole, size = Math.min(Math.max(to - from, 0.02), end - begin);
  state.from = Math.min(Math.max(from, begin), end - size);
  state.to = state.from + size;
  draw();
}

function zoom(factor, middle = (state.from + state.to) / 2) {
  view(middle - (middle - state.from) * factor, middle + (state.to - middle) * factor);
}

function move(share) { const by = share * (state.to - state.from); view(state.from + by, state.to + by); }

function timeAt(event) {
  const box = picture.getBoundingClientRect();
  return state.from + (event.clientX - box.left - 62) / (box.width - 72) * (state.to - state.from);
}

function followPointers() {
  const held = new Map();
  picture.addEventListener("pointerdown", (event) => { held.set(event.pointerId, event); picture.setPointerCapture(event.pointerId); });
  for (const name of ["pointerup", "pointercancel"]) picture.addEventListener(name, (event) => held.delete(event.pointerId));
  picture.addEventListener("pointermove", (event) => {
    const before = held.get(event.pointerId);
    if (!before) { state.instant = timeAt(event); draw(); return; }
    const other = [...held.values()].find((one) => one.pointerId !== event.pointerId);
    const [was, is] = [timeAt(before), timeAt(event)];
    held.set(event.pointerId, event);
    if (!other) { view(state.from + was - is, state.to + was - is); return; }
    const fixed = timeAt(other);
    if (Math.abs(is - fixed) > 1e-6) zoom(Math.min(Math.max((was - fixed) / (is - fixed), 0.5), 2), fixed);
  });
  picture.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(event.deltaY / 400), timeAt(event)); }, { passive: false });
}

const KEYS = {
  "+": () => zoom(0.6), "=": () => zoom(0.6), "-": () => zoom(1 / 0.6), ArrowLeft: () => move(-0.25), ArrowRight: () => move(0.25),
  Home: () => view(...state.whole),
};
const BUTTONS = { in: "+", out: "-", left: "ArrowLeft", right: "ArrowRight", all: "Home" };

function begin() {
  if (typeof DecompressionStream === "undefined") {
    at("said").textContent = "This browser cannot unpack the traces; a newer one can (Firefox 113, Chrome 80, Safari 16.4).";
    return;
  }
  options(at("session"), sessions.map((one) => [one.session, one.participant, one.condition].filter(Boolean).join(" \u00b7 ")));
  at("session").addEventListener("change", (event) => open(Number(event.target.value)));
  at("axis").addEventListener("change", (event) => { state.axis = event.target.selectedOptions[0].textContent; draw(); });
  at("previous").addEventListener("click", () => open(state.index - 1));
  at("next").addEventListener("click", () => open(state.index + 1));
  for (const [id, key] of Object.entries(BUTTONS)) at(id).addEventListener("click", KEYS[key]);
  picture.addEventListener("keydown", (event) => { const act = KEYS[event.key]; if (act) { event.preventDefault(); act(); } });
  followPointers();
  startPlayer();
  window.addEventListener("resize", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { listLines(); draw(); });
  const wanted = Number(location.hash.slice(1)) - 1;
  open(wanted in sessions ? wanted : 0);
}

begin();
