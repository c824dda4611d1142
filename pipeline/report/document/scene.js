// What is seen of a session at one moment, as shapes: on one side the whole plane, on the other a close-up that keeps
// the hand at its centre. In the close-up lag is a distance from the centre, and jitter a tremble.
//
// `played` is { scene, lines: { hand, displayed, compared }, bounds, route }; a line is null where the session has none,
// and the route is the way through the whole session in mm: the task's path, else the hand's.

const TAIL_S = 1.5, LABELLED_S = 2.5, ROW = 19, ROUTE_POINTS = 1500;
const ROLES = ["displayed", "compared", "hand"]; // painted in this order
const onDark = () => matchMedia("(prefers-color-scheme: dark)").matches;

function roleColour(role, colours) {
  if (role === "hand") return colours.ink;
  return role === "displayed" ? (onDark() ? "#ff8f3d" : "#c24e00") : onDark() ? "#56b4e9" : "#0072b2";
}

// Where a line is at an instant: a display and an estimate stay until the next one, a hand moves in between.
function placeAt(line, plane, instant) {
  if (line.kind === "reference") return plane.map((axis) => between(line, axis, instant));
  const index = last(line.time, instant);
  return index < 0 ? [NaN, NaN] : plane.map((axis) => line.values[axis]?.[index] ?? NaN);
}

const known = (place) => Boolean(place) && !isNaN(place[0]) && !isNaN(place[1]);
const distance = (a, b) => known(a) && known(b) ? Math.hypot(a[0] - b[0], a[1] - b[1]) : NaN;

function placesAt(played, instant) {
  return Object.fromEntries(ROLES.map((role) => {
    const line = played.lines[role];
    return [role, line ? placeAt(line, played.scene.plane, instant) : [NaN, NaN]];
  }));
}

function boundsOf(scene, lines) {
  const box = { left: Infinity, right: -Infinity, low: Infinity, high: -Infinity };
  const include = (x, y) => {
    if (isNaN(x) || isNaN(y)) return;
    box.left = Math.min(box.left, x); box.right = Math.max(box.right, x);
    box.low = Math.min(box.low, y); box.high = Math.max(box.high, y);
  };
  for (const [x, y] of [...scene.path, ...scene.targets, ...scene.events.map((event) => event.target).filter(Boolean)]) include(x, y);
  for (const line of [lines.hand, lines.displayed]) {
    if (!line || !scene.plane.every((axis) => line.values[axis])) continue;
    const [across, up] = scene.plane.map((axis) => line.values[axis]);
    for (let i = 0; i < line.n; i++) include(across[i], up[i]);
  }
  if (box.left > box.right) return { left: -1, right: 1, low: -1, high: 1 };
  const room = Math.max(box.right - box.left, box.high - box.low, 1) * 0.04;
  return { left: box.left - room, right: box.right + room, low: box.low - room, high: box.high + room };
}

function routeOf(scene, lines) {
  const line = lines.hand ?? lines.displayed;
  if (scene.path.length || !line) return scene.path;
  const [across, up] = scene.plane.map((axis) => line.values[axis]), points = [];
  for (let i = 0; i < line.n; i += Math.ceil(line.n / ROUTE_POINTS)) if (known([across[i], up[i]])) points.push([across[i], up[i]]);
  return points;
}

// From millimetres to pixels of a box, equally long both ways, the middle in the middle.
function projection(bounds, box) {
  const scale = Math.min(box.width / (bounds.right - bounds.left), box.height / (bounds.high - bounds.low));
  const [x, y] = [(bounds.left + bounds.right) / 2, (bounds.low + bounds.high) / 2];
  const to = (place) => [box.x + box.width / 2 + (place[0] - x) * scale, box.y + box.height / 2 - (place[1] - y) * scale];
  return { to, scale };
}

function around(place, size) {
  return { left: place[0] - size / 2, right: place[0] + size / 2, low: place[1] - size / 2, high: place[1] + size / 2 };
}

function closeUpSize(played) {
  return played.scene.window ? 2.1 * Math.max(...played.scene.window) : Math.min(160, 0.5 * (played.bounds.right - played.bounds.left));
}

function moment(played, instant, width, height, colours) {
  const wide = width >= 640, top = ROW * 3 + 8, side = wide ? Math.min(height - top, width * 0.38) : Math.min((height - top) * 0.55, width);
  const whole = wide ? { x: 0, y: top, width: width - side - 12, height: height - top } : { x: 0, y: top, width, height: height - top - side - 12 };
  const close = wide ? { x: width - side, y: top, width: side, height: height - top } : { x: 0, y: height - side, width, height: side };
  const places = placesAt(played, instant), centre = known(places.hand) ? places.hand : places.displayed;
  const shapes = [...legendShapes(played, places, colours), panelShapes(played, instant, places, whole, projection(played.bounds, whole), colours, "The whole plane")];
  if (known(centre)) {
    const near = projection(around(centre, closeUpSize(played)), close);
    shapes.push(panelShapes(played, instant, places, close, near, colours, known(places.hand) ? "Close-up around the hand" : "Close-up"));
  }
  return shapes;
}

function panelShapes(played, instant, places, box, view, colours, title) {
  const scale = scaleShapes(box, view.scale, colours);
  const inner = [...taskShapes(played, instant, view, colours), ...selectionShapes(played.scene, instant, view, colours),
    ...windowShapes(played.scene, places.displayed, view, colours), ...lineShapes(played, instant, places, view, colours), ...scale];
  inner.push({ type: "text", x: box.x + 8, y: box.y + 18, text: title, colour: colours.soft });
  inner.push({ type: "rect", x: box.x + 0.5, y: box.y + 0.5, width: box.width - 1, height: box.height - 1, colour: colours.line });
  return { type: "group", box, shapes: inner };
}

function taskShapes({ scene, route }, instant, view, colours) {
  const shapes = [], radius = Math.max(2.5, (scene.diameter ?? 0) / 2 * view.scale), seen = new Set();
  if (route.length) shapes.push({ type: "line", points: route.map(view.to), colour: colours.line, stroke: scene.path.length ? 3 : 1.2 });
  for (const target of [...scene.targets, ...scene.events.map((event) => event.target)]) {
    if (!target || seen.has(String(target))) continue;
    seen.add(String(target));
    const [x, y] = view.to(target);
    shapes.push({ type: "circle", x, y, radius, colour: colours.soft, stroke: 1.2 });
  }
  const current = currentTarget(scene, instant);
  if (current) {
    const [x, y] = view.to(current);
    shapes.push({ type: "circle", x, y, radius, fill: "#009e73", colour: colours.ink, stroke: 1.5, opacity: 0.75 });
  }
  return shapes;
}

function currentTarget(scene, instant) {
  const before = scene.events.filter((event) => event.time <= instant), newest = before[before.length - 1];
  return newest && newest.type === "trial_start" ? newest.target : null;
}

function selectionShapes(scene, instant, view, colours) {
  const below = (scene.window ? scene.window[1] / 2 * view.scale : 8) + 20; // clear of the window around it
  return scene.events.filter((event) => event.type === "selection" && event.at && event.time <= instant).flatMap((event) => {
    const [x, y] = view.to(event.at), shapes = [];
    for (const slant of [-4, 4]) shapes.push({ type: "line", points: [[x - 4, y - slant], [x + 4, y + slant]], colour: colours.ink, stroke: 1.6 });
    if (event.target) shapes.push({ type: "line", points: [view.to(event.target), [x, y]], colour: colours.ink });
    if (event.target && instant - event.time < LABELLED_S) {
      shapes.push({ type: "text", x: x - 4, y: y + below, text: `selected ${millimetres(distance(event.at, event.target))} off`, colour: colours.ink });
    }
    return shapes;
  });
}

function windowShapes(scene, centre, view, colours) {
  if (!scene.window || !known(centre)) return [];
  const [x, y] = view.to(centre), [width, height] = scene.window.map((size) => size * view.scale);
  return [{ type: "rect", x: x - width / 2, y: y - height / 2, width, height, colour: roleColour("displayed", colours), stroke: 1.5 }];
}

function lineShapes(played, instant, places, view, colours) {
  return ROLES.flatMap((role) => {
    const line = played.lines[role];
    if (!line) return [];
    const colour = roleColour(role, colours), points = tail(line, played.scene.plane, instant, view), shapes = [];
    if (points.length > 1) shapes.push({ type: "line", points, colour, stroke: role === "hand" ? 2 : 1.5, opacity: 0.7, dash: role === "compared" ? [5, 3] : undefined });
    if (known(places[role])) {
      const [x, y] = view.to(places[role]);
      shapes.push({ type: "circle", x, y, radius: role === "hand" ? 6 : 4.5, colour, fill: role === "hand" ? undefined : colour, stroke: 2 });
    }
    return shapes;
  });
}

function tail(line, plane, instant, view) {
  const points = [], end = last(line.time, instant), [across, up] = plane.map((axis) => line.values[axis]);
  if (!across || !up) return points;
  for (let i = Math.max(last(line.time, instant - TAIL_S), 0); i <= end; i++) {
    if (!isNaN(across[i]) && !isNaN(up[i])) points.push(view.to([across[i], up[i]]));
  }
  const now = placeAt(line, plane, instant);
  if (known(now)) points.push(view.to(now));
  return points;
}

function scaleShapes(box, scale, colours) {
  const length = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000].find((one) => one * scale >= 50) ?? 10000;
  const [x, y] = [box.x + 10, box.y + box.height - 12];
  return [{ type: "line", points: [[x, y - 4], [x, y], [x + length * scale, y], [x + length * scale, y - 4]], colour: colours.soft, stroke: 1.3 },
    { type: "text", x: x + length * scale + 7, y: y + 2, text: `${length} mm`, colour: colours.soft }];
}

function legendShapes(played, places, colours) {
  return ["hand", "displayed", "compared"].filter((role) => played.lines[role]).flatMap((role, row) => {
    const y = ROW * row + 10, colour = roleColour(role, colours), off = distance(places[role], places.hand);
    const text = roleName(role, played) + (role !== "hand" && !isNaN(off) ? `: ${millimetres(off)} off` : "");
    return [{ type: "circle", x: 9, y, radius: role === "hand" ? 6 : 4.5, colour, fill: role === "hand" ? undefined : colour, stroke: 2 },
      { type: "text", x: 22, y: y + 5, text, colour: colours.ink }];
  });
}

function roleName(role, played) {
  const line = played.lines[role], shown = played.scene.displayed_by;
  if (role === "hand") return `true hand (${shortened(line.name)})`;
  if (role === "compared") return `${shortened(line.name)} would have shown`;
  if (line.kind === "display") return shown ? `displayed (${shortened(shown)})` : "displayed";
  return line.kind === "tracker" ? `${shortened(line.name)} as it arrived` : `displayed by ${shortened(line.name)}`;
}

function shortened(name) { return name.length > 16 ? name.slice(0, 15) + "\u2026" : name; }

const millimetres = (size) => isNaN(size) ? "\u2013" : `${size.toFixed(1)}\u202fmm`;
