// The phone's motion, sent as the browser gives it: signs, axes and units are the server's to find from the data, since
// browsers differ in all three and none says so.

import { clockMs } from "./socket.js";

const PATIENCE_MS = 1000; // for a first reading; a computer without sensors sends a single one full of nulls, or none
const ORIENTATION_HZ = 60;
const STILL_MS = 100;

// "granted", "denied", "unneeded" (the browser does not ask) or "unavailable". iOS asks only within a tap, and only where
// nothing was waited for since, so both questions are put at once.
export async function askPermission() {
  if (!globalThis.DeviceMotionEvent) return "unavailable";
  const kinds = [DeviceMotionEvent, globalThis.DeviceOrientationEvent].filter((kind) => kind?.requestPermission);
  const asked = kinds.map((kind) => kind.requestPermission().catch(() => "denied"));
  if (!asked.length) return "unneeded";
  return (await Promise.all(asked)).every((answer) => answer === "granted") ? "granted" : "denied";
}

function vector(given, names) {
  return given && names.every((name) => Number.isFinite(given[name])) ? names.map((name) => given[name]) : null;
}

// Send readings from now on. Whether any came within a second.
export function startMotion(send) {
  const turning = startOrientation(send);
  return new Promise((resolve) => {
    let seq = 0;
    setTimeout(() => resolve(seq > 0), PATIENCE_MS);
    addEventListener("devicemotion", (event) => {
      const a = vector(event.accelerationIncludingGravity, ["x", "y", "z"]);
      const r = vector(event.rotationRate, ["alpha", "beta", "gamma"]);
      if (!a && !r) return;
      const l = vector(event.acceleration, ["x", "y", "z"]);
      send({ type: "motion", seq: seq++, t: clockMs(event.timeStamp), a, l, r, i: event.interval });
      turning.stillAt(event.timeStamp);
      resolve(true);
    });
  });
}

// The finer sensor where the browser has it, else the angles of `deviceorientation`. Neither need come at all. Some browsers
// say nothing while the phone does not turn; then its last orientation is sent again now and then, for it still holds.
function startOrientation(send) {
  let [seq, last, sentAt] = [0, null, 0];
  const turned = (timeStamp, q, absolute) => {
    [last, sentAt] = [{ q, absolute }, timeStamp];
    send({ type: "orientation", seq: seq++, t: clockMs(timeStamp), ...last });
  };
  const stillAt = (timeStamp) => {
    if (last && timeStamp - sentAt > STILL_MS) turned(timeStamp, last.q, last.absolute);
  };
  if (!listenToSensor(turned)) listenToAngles(turned);
  return { stillAt };
}

function listenToSensor(turned) {
  try {
    const sensor = new RelativeOrientationSensor({ frequency: ORIENTATION_HZ });
    sensor.addEventListener("reading", () => turned(sensor.timestamp || performance.now(), [...sensor.quaternion], false));
    sensor.addEventListener("error", () => listenToAngles(turned), { once: true });
    sensor.start();
    return true;
  } catch {
    return false; // a browser that has no such sensor, or does not allow it
  }
}

function listenToAngles(turned) {
  addEventListener("deviceorientation", (event) => {
    const angles = vector(event, ["alpha", "beta", "gamma"]);
    if (angles) turned(event.timeStamp, quaternion(...angles), event.absolute);
  });
}

// x, y, z, w of the angles in degrees, which turn about z, then x', then y'' (W3C, Device Orientation and Motion, 3.1).
export function quaternion(alpha, beta, gamma) {
  const half = (degrees) => [Math.cos((degrees * Math.PI) / 360), Math.sin((degrees * Math.PI) / 360)];
  const [[cx, sx], [cy, sy], [cz, sz]] = [half(beta), half(gamma), half(alpha)];
  return [
    sx * cy * cz - cx * sy * sz,
    cx * sy * cz + sx * cy * sz,
    cx * cy * sz + sx * sy * cz,
    cx * cy * cz - sx * sy * sz,
  ];
}
