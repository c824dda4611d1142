// What the phone shows: a window onto the canvas, centred on the newest estimate, with the path, the targets and a cross.
//
// Lengths are mm of the canvas, y upwards, until `toScreen`. The window keeps its shape and is as large as the screen
// allows, or as it is in truth; where the screen is longer, the window leaves the button its room, so that it covers nothing.

const CHEVRON_EVERY_MM = 60; // arrowheads along the path: at a crossing nobody need guess which way to go
const CROSS_PX = 9;

// The window on the screen: left, top, width, height in CSS px, and px per mm, which are at most `largest`. The button is on
// `side` and wants `room` px.
export function placed(task, width, height, { side, room, largest }) {
  const [width_mm, height_mm] = task.window_mm ?? extent(task);
  const scale = Math.min(width / width_mm, height / height_mm, largest);
  const box = { width: width_mm * scale, height: height_mm * scale, scale };
  const spare = width - box.width;
  const away = Math.max(0, Math.min(spare / 2, spare - room)); // from the edge that is not the button's
  return { ...box, left: side === "right" ? away : spare - away, top: width > height ? (height - box.height) / 2 : 0 };
}

function extent({ canvas_x_mm: [x0, x1], canvas_y_mm: [y0, y1] }) {
  return [x1 - x0, y1 - y0];
}

// From mm to px. Where all is in view the canvas stands still and the estimate is marked on it.
function transform(task, box, estimate) {
  const still = !task.window_mm;
  const [x, y] = still ? middle(task) : [estimate.x, estimate.y];
  const [left, top] = [box.left + box.width / 2, box.top + box.height / 2];
  return ([px, py]) => [left + (px - x) * box.scale, top - (py - y) * box.scale];
}

function middle({ canvas_x_mm, canvas_y_mm }) {
  return [canvas_x_mm, canvas_y_mm].map(([from, to]) => (from + to) / 2);
}

// A place on the screen as one on the canvas when the pointer is the hand: all of the screen stands for all of the canvas.
export function handAt(task, width, height, px, py) {
  const share = (from, to, part) => from + (to - from) * Math.min(1, Math.max(0, part));
  return { x: share(...task.canvas_x_mm, px / width), y: share(...task.canvas_y_mm, 1 - py / height) };
}

export function draw(context, task, box, estimate, target, look) {
  const toScreen = transform(task, box, estimate);
  context.save();
  context.beginPath();
  context.rect(box.left, box.top, box.width, box.height);
  context.clip();
  drawGround(context, task, box, toScreen, look);
  drawPath(context, task, box, toScreen, look);
  task.targets_mm.forEach((place, index) => {
    drawTarget(context, toScreen(place), (task.target_diameter_mm / 2) * box.scale, index === target, look);
  });
  drawCross(context, toScreen([estimate.x, estimate.y]), look);
  drawWayBack(context, task, box, estimate, look);
  context.restore();
}

// Beyond the canvas's edge it is grey.
function drawGround(context, { canvas_x_mm, canvas_y_mm }, box, toScreen, look) {
  context.fillStyle = look.beyond;
  context.fillRect(box.left, box.top, box.width, box.height);
  const [left, top] = toScreen([canvas_x_mm[0], canvas_y_mm[1]]);
  const [right, bottom] = toScreen([canvas_x_mm[1], canvas_y_mm[0]]);
  context.fillStyle = look.paper;
  context.fillRect(left, top, right - left, bottom - top);
}

function drawPath(context, { path_mm }, box, toScreen, look) {
  context.strokeStyle = look.path;
  context.lineWidth = Math.max(2, 1.2 * box.scale);
  context.lineJoin = "round";
  context.beginPath();
  for (const place of path_mm) context.lineTo(...toScreen(place));
  context.stroke();
  const size = Math.max(4, 2.2 * box.scale);
  for (const { place, direction } of chevrons(path_mm)) drawChevron(context, toScreen(place), direction, size);
}

// Places along the path with the direction in which it goes, as an angle on the canvas.
export function chevrons(path_mm) {
  const marks = [];
  for (let i = 1; i < path_mm.length; i++) {
    const [[x0, y0], [x1, y1]] = [path_mm[i - 1], path_mm[i]];
    const count = Math.max(1, Math.floor(Math.hypot(x1 - x0, y1 - y0) / CHEVRON_EVERY_MM));
    for (let k = 0; k < count; k++) {
      const part = (k + 0.5) / count;
      marks.push({ place: [x0 + part * (x1 - x0), y0 + part * (y1 - y0)], direction: Math.atan2(y1 - y0, x1 - x0) });
    }
  }
  return marks;
}

function drawChevron(context, [x, y], direction, size) {
  const end = (turn) => [x - size * Math.cos(direction + turn), y + size * Math.sin(direction + turn)];
  context.beginPath();
  context.moveTo(...end(0.7));
  context.lineTo(x, y);
  context.lineTo(...end(-0.7));
  context.stroke();
}

function drawTarget(context, [x, y], radius, current, look) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fillStyle = current ? look.target : look.paper;
  context.fill();
  context.lineWidth = current ? 3 : 2;
  context.strokeStyle = current ? look.ink : look.soft;
  context.stroke();
}

function drawCross(context, [x, y], look) {
  const strokes = [[look.paper, 5], [look.ink, 2]]; // a rim, so that it is seen on the path and on a target
  for (const [style, width] of strokes) {
    context.strokeStyle = style;
    context.lineWidth = width;
    context.beginPath();
    for (const [dx, dy] of [[CROSS_PX, 0], [0, CROSS_PX]]) {
      context.moveTo(x - dx, y - dy);
      context.lineTo(x + dx, y + dy);
    }
    context.stroke();
  }
}

// Where nothing of the path is in view, an arrow at the window's edge points to its nearest place. It says nothing of the
// targets, and is the same whatever is shown.
function drawWayBack(context, task, box, estimate, look) {
  const nearest = nearestOnPath(task.path_mm, estimate);
  const [dx, dy] = [(nearest[0] - estimate.x) * box.scale, (estimate.y - nearest[1]) * box.scale];
  if (!task.window_mm || (Math.abs(dx) < box.width / 2 && Math.abs(dy) < box.height / 2)) return;
  const reach = 0.6 * Math.min(box.width / 2 / Math.abs(dx), box.height / 2 / Math.abs(dy));
  context.save();
  context.translate(box.left + box.width / 2 + dx * reach, box.top + box.height / 2 + dy * reach);
  context.rotate(Math.atan2(dy, dx));
  context.fillStyle = look.path;
  context.fill(new Path2D("M 22 0 L -6 16 L -6 6 L -26 6 L -26 -6 L -6 -6 L -6 -16 Z"));
  context.restore();
}

export function nearestOnPath(path_mm, { x, y }) {
  let best = path_mm[0];
  for (let i = 1; i < path_mm.length; i++) {
    const [[x0, y0], [x1, y1]] = [path_mm[i - 1], path_mm[i]];
    const squared = (x1 - x0) ** 2 + (y1 - y0) ** 2 || 1;
    const part = Math.min(1, Math.max(0, ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / squared));
    const place = [x0 + part * (x1 - x0), y0 + part * (y1 - y0)];
    if (Math.hypot(place[0] - x, place[1] - y) < Math.hypot(best[0] - x, best[1] - y)) best = place;
  }
  return best;
}
