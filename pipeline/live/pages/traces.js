// The last seconds of x: what the tracker said (dots) and what was shown (line).

const SPAN_S = 6;
const LEAST_MM = 20; // a hand held still is not blown up to fill the picture
const MARGIN_PX = 8;
const LABELS_PX = 46;

export function drawTraces(canvas, { t_s, raw_mm, shown_mm }) {
  const [width, height, ratio] = [canvas.clientWidth, canvas.clientHeight, devicePixelRatio];
  Object.assign(canvas, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  const colour = (name) => getComputedStyle(canvas).getPropertyValue(`--${name}`).trim();
  const [low, high] = range([...raw_mm, ...shown_mm].filter((value) => value !== null));
  const x = (t) => LABELS_PX + (width - LABELS_PX - MARGIN_PX) * (1 + t / SPAN_S);
  const y = (value) => MARGIN_PX + (height - 2 * MARGIN_PX) * (1 - (value - low) / (high - low));
  drawLabels(context, [low, high], y, width, colour);
  drawDots(context, t_s.map((t, i) => [x(t), raw_mm[i] === null ? null : y(raw_mm[i])]), colour("soft"));
  drawLine(context, t_s.map((t, i) => [x(t), shown_mm[i] === null ? null : y(shown_mm[i])]), colour("path"));
}

function range(values) {
  if (!values.length) return [0, LEAST_MM];
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const more = Math.max(0, LEAST_MM - (high - low)) / 2;
  return [low - more, high + more];
}

function drawLabels(context, values, y, width, colour) {
  context.font = "12px system-ui, sans-serif";
  context.textBaseline = "middle";
  context.textAlign = "right";
  context.lineWidth = 1;
  for (const value of values) {
    context.fillStyle = colour("soft");
    context.fillText(Math.round(value).toString().replace("-", "\u2212"), LABELS_PX - 6, y(value));
    context.strokeStyle = colour("line");
    context.beginPath();
    context.moveTo(LABELS_PX, y(value));
    context.lineTo(width - MARGIN_PX, y(value));
    context.stroke();
  }
}

function drawDots(context, points, colour) {
  context.fillStyle = colour;
  for (const [x, y] of points) if (y !== null) context.fillRect(x - 1.5, y - 1.5, 3, 3);
}

function drawLine(context, points, colour) {
  context.strokeStyle = colour;
  context.lineWidth = 2;
  context.beginPath();
  let pen = false; // lifted where nothing is known
  for (const [x, y] of points) {
    if (y !== null) context[pen ? "lineTo" : "moveTo"](x, y);
    pen = y !== null;
  }
  context.stroke();
}
