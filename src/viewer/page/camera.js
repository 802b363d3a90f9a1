// The camera: orbit, pan and zoom. A camera is {eye, at, up, fovy}, as in a scene file; vectors are arrays of three.

const add = (a, b, k = 1) => a.map((v, i) => v + k * b[i]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a, k) => a.map((v) => v * k);
const unit = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));

// Nearest angle between the view and up, radians: at 0 there is no horizon.
const POLE = 0.02;

function axes(camera) {
  const back = add(camera.eye, camera.at, -1);
  const right = unit(cross(camera.up, back));
  return { back, right, up: unit(cross(back, right)) };
}

// v turned by `angle` about the unit vector `axis` (Rodrigues).
function turned(v, axis, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return add(add(scaled(v, c), cross(axis, v), s), axis, dot(axis, v) * (1 - c));
}

// Turns the eye about the point that is looked at: by `right` about up, by `down` about the horizon; radians.
export function orbit(camera, right, down) {
  const { back, right: horizon } = axes(camera);
  const up = unit(camera.up);
  const angle = Math.acos(Math.min(1, Math.max(-1, dot(up, unit(back)))));
  const tilt = Math.min(Math.max(angle - down, POLE), Math.PI - POLE) - angle;
  const eye = turned(turned(back, horizon, tilt), up, -right);
  return { ...camera, eye: add(camera.at, eye) };
}

// Two turns one after the other, as quaternions [x, y, z, w]: `a` after `b`.
function after(a, b) {
  const [p, q] = [a.slice(0, 3), b.slice(0, 3)];
  return unit([...add(add(scaled(q, a[3]), p, b[3]), cross(p, q)), a[3] * b[3] - dot(p, q)]);
}
const about = (axis, angle) => [...scaled(axis, Math.sin(angle / 2)), Math.cos(angle / 2)];

// Turns lights, whose turn is a quaternion, by `right` about the camera's up and by `down` about its horizon; radians.
export function turnLights(turn, camera, right, down) {
  const { right: horizon, up } = axes(camera);
  return after(about(horizon, down), after(about(up, right), turn));
}

// Moves the camera by shares of the image's height, so that what is at the point looked at follows the hand.
export function pan(camera, right, down) {
  const axis = axes(camera);
  const height = 2 * Math.hypot(...axis.back) * Math.tan(camera.fovy * Math.PI / 360);
  const move = add(scaled(axis.right, -right * height), axis.up, down * height);
  return { ...camera, eye: add(camera.eye, move), at: add(camera.at, move) };
}

// Brings the eye nearer (`by` < 1) or farther.
export function zoom(camera, by) {
  return { ...camera, eye: add(camera.at, add(camera.eye, camera.at, -1), by) };
}
