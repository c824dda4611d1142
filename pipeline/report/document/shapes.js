"use strict";
// Shapes as plain data, painted on a canvas or written as SVG: a still holds exactly what is seen.
//
// { type: "line", points: [[x, y], …], colour, stroke?, dash?, opacity? }   { type: "rect", x, y, width, height, colour, fill? }
// { type: "circle", x, y, radius, colour, fill?, stroke? }                { type: "text", x, y, text, colour, align? }
// { type: "group", box: { x, y, width, height }, shapes }                 cuts off what is outside its box

const FONT_PX = 13, FAMILY = "'Steadyhand Sans', system-ui, sans-serif";
const SVG = "http://www.w3.org/2000/svg";

const PAINT = {
  line(context, shape) {
    context.beginPath();
    for (const [x, y] of shape.points) context.lineTo(x, y);
    context.stroke();
  },
  rect(context, shape) {
    if (shape.fill) context.fillRect(shape.x, shape.y, shape.width, shape.height);
    if (shape.colour) context.strokeRect(shape.x, shape.y, shape.width, shape.height);
  },
  circle(context, shape) {
    context.beginPath();
    context.arc(shape.x, shape.y, shape.radius, 0, 2 * Math.PI);
    if (shape.fill) context.fill();
    if (shape.colour) context.stroke();
  },
  text(context, shape) {
    context.fillStyle = shape.colour;
    context.textAlign = shape.align ?? "left";
    context.fillText(shape.text, shape.x, shape.y);
  },
  group(context, shape) {
    context.beginPath();
    context.rect(shape.box.x, shape.box.y, shape.box.width, shape.box.height);
    context.clip();
    paint(context, shape.shapes);
  },
};

function paint(context, shapes) {
  for (const shape of shapes) {
    context.save();
    context.font = `${FONT_PX}px ${FAMILY}`;
    context.lineJoin = "round";
    context.globalAlpha = shape.opacity ?? 1;
    context.strokeStyle = shape.colour;
    context.fillStyle = shape.fill;
    context.lineWidth = shape.stroke ?? 1;
    context.setLineDash(shape.dash ?? []);
    PAINT[shape.type](context, shape);
    context.restore();
  }
}

// Attributes only: the page's policy forbids styles.
function svgOf(shapes, width, height, title) {
  const root = element("svg", { width, height, viewBox: `0 0 ${width} ${height}`, role: "img", "font-family": FAMILY, "font-size": FONT_PX });
  root.append(withText(element("title", {}), title));
  appendShapes(root, shapes);
  return new XMLSerializer().serializeToString(root);
}

function appendShapes(parent, shapes) { for (const shape of shapes) parent.append(...WRITE[shape.type](shape)); }

function element(name, attributes) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, typeof value === "number" ? +value.toFixed(2) : value);
  return made;
}

// XML has no way to say some characters, which a log's names may hold.
function withText(node, text) { node.textContent = text.replace(/[\p{Cc}\p{Cs}\ufffe\uffff]/gu, "\u25a1"); return node; }

function drawn(shape) {
  const look = { fill: shape.fill ?? "none", stroke: shape.colour ?? "none", "stroke-width": shape.stroke ?? 1, opacity: shape.opacity ?? 1 };
  return shape.dash ? { ...look, "stroke-dasharray": shape.dash.join(" ") } : look;
}

let clips = 0;
const ANCHORS = { left: "start", center: "middle", right: "end" };
const WRITE = {
  line: (shape) => [element("polyline", { ...drawn(shape), "stroke-linejoin": "round",
    points: shape.points.map(([x, y]) => `${x.toFixed(2)},${y.toFixed(2)}`).join(" ") })],
  rect: (shape) => [element("rect", { ...drawn(shape), x: shape.x, y: shape.y, width: shape.width, height: shape.height })],
  circle: (shape) => [element("circle", { ...drawn(shape), cx: shape.x, cy: shape.y, r: shape.radius })],
  text: (shape) => [withText(element("text", { x: shape.x, y: shape.y, fill: shape.colour, "text-anchor": ANCHORS[shape.align ?? "left"] }), shape.text)],
  group(shape) {
    const id = `clip-${++clips}`, clip = element("clipPath", { id }), group = element("g", { "clip-path": `url(#${id})` });
    clip.append(element("rect", shape.box));
    appendShapes(group, shape.shapes);
    return [clip, group];
  },
};
