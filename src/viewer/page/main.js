// The page holds the whole view, and sends it whenever something changes. So it can go on with a program that was
// started again. `viewer` is there for tests, and for the curious: it holds the view and a log of pictures.

import { orbit, pan, turnLights, zoom } from "./camera.js";
import { View } from "./canvas.js";
import { keys } from "./keys.js";

const $ = (id) => document.getElementById(id);
const view = new View($("stage"), $("picture"), $("slider"));

// What is seen. `null`: the scene's own.
const state = {
  frame: 0, camera: null, path: null, lights: null, shutter: null, mode: "auto:good", split: null, buffer: "colour",
  backend: "auto", prefilter: null, shading: "phong", size: "window",
};
let scene = null;
let socket = null;
let serial = 0;
let shown = -1; // serial of the last picture
let last = null; // header of the last picture
let playing = null;
let moving = false;
let rest = 0;
let dirty = false;
let tries = 0;
let ratio = devicePixelRatio;
const sentAt = new Map();
const log = [];
window.viewer = { state, log, view, get scene() { return scene; }, get last() { return last; }, get serial() { return serial; }, get keys() { return KEYS; } };

// ---- to the program

function change(keys, isMoving = false) {
  Object.assign(state, keys);
  moving = isMoving || playing !== null;
  dirty = true;
  clearTimeout(rest);
  // What moved and stops without a word, as a wheel does, rests a little later.
  if (isMoving) rest = setTimeout(() => change({}), 200);
}

function flush() {
  requestAnimationFrame(flush);
  // Another screen may have other pixels for the same window.
  if (ratio !== devicePixelRatio) {
    ratio = devicePixelRatio;
    change({});
  }
  if (playing) advance();
  if (!dirty || !scene || socket?.readyState !== WebSocket.OPEN) return;
  dirty = false;
  const fitted = view.fit(scene.width, scene.height, devicePixelRatio);
  const [width, height] = state.size === "scene" ? [scene.width, scene.height] : fitted;
  const { size: _, ...asked } = state;
  serial += 1;
  sentAt.set(serial, performance.now());
  if (sentAt.size > 256) sentAt.delete(sentAt.keys().next().value);
  socket.send(JSON.stringify({ type: "view", serial, width, height, moving, ...asked }));
  fill();
}

const save = (what) => socket?.readyState === WebSocket.OPEN && socket.send(JSON.stringify({ type: "save", what }));

// A second press stops the movie under way.
let filming = false;
function film() {
  if (socket?.readyState !== WebSocket.OPEN) return;
  socket.send(JSON.stringify({ type: "movie", format: filming ? null : $("movie-format").value }));
}
function films(isUnderWay) {
  filming = isUnderWay;
  $("save-movie").textContent = filming ? "stop" : "movie";
}

// ---- from the program

function connect() {
  socket = new WebSocket(`ws://${location.host}${location.pathname}socket`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => { tries = 0; shown = -1; say("connected"); change({}); };
  socket.onmessage = ({ data }) => (typeof data === "string" ? told(JSON.parse(data)) : picture(data));
  socket.onclose = ({ reason }) => {
    films(false);
    tries += 1;
    const hint = tries > 3 ? "; if the program was started again, open the link that it prints now" : "";
    say(`not connected${reason ? `: ${reason}` : ""}${hint}`);
    setTimeout(connect, Math.min(250 * tries, 2000));
  };
}

function told(message) {
  const kinds = {
    loading: () => say("loading"),
    scene: () => begin(message),
    broken: () => alert(message.message, Infinity),
    refused: () => { shown = serial; alert(message.message, serial); },
    saved: () => { films(false); $("saved").textContent = message.path; },
    filming: () => { films(true); $("saved").textContent = `movie: ${message.done} of ${message.frames} frames`; },
    filmed: () => { if (filming) $("saved").textContent = "there is no movie"; films(false); },
    rests: () => { say(`rests${rateText()}`); window.viewer.rests = message.serial; },
    compared: () => {
      window.viewer.compared = message;
      const samples = message.samples ? ` of ${message.samples} samples` : "";
      $("compared").textContent = `left against right${samples}: FLIP ${message.flip.toFixed(4)}, RMSE ${message.rmse.toFixed(5)}`;
    },
  };
  kinds[message.type]?.();
}

function begin(fresh) {
  const isFirst = scene === null || scene.name !== fresh.name;
  scene = fresh;
  alert("");
  document.title = `${scene.name} - splatblur view`;
  $("name").textContent = scene.name;
  const count = scene.surfels.toLocaleString("en");
  $("about").textContent = `${scene.objects} objects, ${count} surfels, ${scene.width} x ${scene.height}, ${scene.program}`;
  $("about").title = scene.notes.join("\n");
  $("grammar").textContent = scene.modes;
  const { first, last: end } = range();
  [$("time").min, $("time").max] = [first, end];
  const inside = state.frame >= first && state.frame <= end;
  if (isFirst) $("rate").value = scene.rate;
  change({ frame: isFirst || !inside ? first : state.frame });
}

async function picture(data) {
  const from = socket;
  const length = new DataView(data).getUint32(0);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  const bitmap = await createImageBitmap(new Blob([new Uint8Array(data, 4 + length)], { type: "image/png" }));
  view.isSplit = state.split !== null;
  view.put(header.side, bitmap);
  if (from === socket && socket.readyState === WebSocket.OPEN) {
    socket.send(JSON.stringify({ type: "shown", picture: header.picture }));
  }
  last = header;
  shown = header.serial;
  const now = performance.now();
  log.push({ ...header, line: undefined, curve: undefined, bytes: data.byteLength, frame: state.frame, sent: sentAt.get(header.serial), shown: now });
  if (log.length > 2000) log.splice(0, 1000);
  if (header.serial > alertEnds) alert("");
  report(header);
}

function report(header) {
  const parts = [header.mode];
  if (header.error !== null) parts.push(`error ${header.error.toFixed(4)}`);
  parts.push(`${header.seconds.toFixed(header.seconds < 1 ? 3 : 1)} s`, `${header.width} x ${header.height}`, `on ${header.backend}`);
  if (header.buffer !== "colour") {
    const range = header.range ? ` ${header.range.map((v) => Number(v.toPrecision(4))).join(" to ")}` : "";
    parts.push(`${header.buffer}${range}`);
  }
  if (!header.finished && header.side !== "second") parts.push("quick");
  const place = header.side === "second" ? $("second") : $("first");
  place.textContent = parts.join(" · ");
  place.title = header.note ?? "";
  if (header.side === "both") $("compared").textContent = "left against right";
  $("line").value = header.line;
  const top = Math.max(...header.curve, 1e-9);
  const step = 100 / header.curve.length;
  const points = header.curve.map((v, i) => `${((i + 0.5) * step).toFixed(2)} ${(31 - 29 * v / top).toFixed(2)}`);
  $("curve").firstElementChild.setAttribute("d", `M0 31L${points.join("L")}L100 31`);
  say((header.finished ? "refined" : moving ? "moving" : "refining") + rateText());
}

// Pictures a second and the time from a change to its picture, over the last second.
function rateText() {
  const now = performance.now();
  const recent = log.filter((entry) => now - entry.shown < 1000 && entry.sent);
  if (recent.length < 2) return "";
  const delay = recent.map((entry) => entry.shown - entry.sent).sort((a, b) => a - b)[recent.length >> 1];
  return `, ${recent.length} pictures/s, ${delay.toFixed(0)} ms`;
}

const say = (text) => { $("state").textContent = text; };
// Serial of the view after which a picture shows that what was wrong is over; what is broken stays until it is mended.
let alertEnds = -1;
function alert(text, ends = -1) {
  alertEnds = text === "" ? Infinity : ends;
  $("alert").hidden = text === "";
  $("alert").textContent = text;
}

// ---- time

// The frames that are seen: those of the path, else of the scene.
function range() {
  const keys = state.path?.keys;
  return keys ? { first: keys[0].frame, last: keys.at(-1).frame } : { first: scene?.first, last: scene?.last };
}

function step(frame) {
  if (!scene) return;
  const { first, last: end } = range();
  const bounded = Math.min(end, Math.max(first, frame));
  change({ frame: bounded });
}

function play() {
  playing = playing ? null : { begin: performance.now(), frame: state.frame, waits: -1 };
  $("play").textContent = playing ? "stop" : "play";
  change({});
}

function advance() {
  // The picture before is still on its way.
  if (!scene || shown < playing.waits) return;
  const { first, last: end } = range();
  const count = end - first + 1;
  const passed = Math.floor((performance.now() - playing.begin) / 1000 * (Number($("rate").value) || scene.rate));
  const frame = first + ((Math.floor(playing.frame) - first + passed) % count + count) % count;
  if (frame === state.frame) return;
  change({ frame });
  playing.waits = serial + 1;
}

// ---- camera

const camera = () => state.camera ?? last?.camera;
function turn(by, isMoving = true) {
  const from = camera();
  if (from) change({ camera: by(from) }, isMoving);
}

// ---- camera path

function setKeys(keys, changes = {}) {
  const path = keys.length ? { keys, constant: $("speed").value === "constant", ease: Math.max(0, Number($("ease").value) || 0) } : null;
  state.path = path;
  const { first, last: end } = range();
  [$("time").min, $("time").max] = [first, end];
  $("path-keys").textContent = path ? `${keys.length} keys, frames ${first} to ${end}` : "no keys";
  change({ frame: Math.min(end, Math.max(first, state.frame)), ...changes });
}
// A key stands at the frame that is seen where the path ends before it, else some frames after its last one.
function addKey() {
  const view = camera();
  if (!scene || !view) return;
  const keys = state.path?.keys ?? [];
  const apart = Math.max(1, Math.round(Number($("apart").value)) || 1);
  const frame = !keys.length ? Math.round(state.frame) : Math.max(Math.round(state.frame), keys.at(-1).frame + apart);
  // The view stays, so that the next one goes on from it.
  setKeys([...keys, { frame, camera: view }], { camera: view });
}
const dropKey = () => setKeys((state.path?.keys ?? []).slice(0, -1));
const retime = () => setKeys(state.path?.keys ?? []);
function fly() {
  if (!state.path) return say("the camera path has no keys yet");
  if (playing) return play();
  change({ camera: null, frame: range().first });
  play();
}

// ---- lights

let draggingLights = false;
function dragLights() {
  draggingLights = !draggingLights;
  $("lights-drag").setAttribute("aria-pressed", draggingLights);
}
function light(right, down) {
  const from = camera();
  if (from) change({ lights: { turn: turnLights(state.lights?.turn ?? [0, 0, 0, 1], from, right, down) } }, true);
}

const canvas = $("picture");
let drag = null;
canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  canvas.focus();
  drag = { x: event.clientX, y: event.clientY, pans: event.shiftKey || event.button !== 0, lights: draggingLights || event.ctrlKey };
  event.preventDefault();
});
canvas.addEventListener("pointermove", (event) => {
  if (!drag) return;
  const [dx, dy] = [event.clientX - drag.x, event.clientY - drag.y];
  [drag.x, drag.y] = [event.clientX, event.clientY];
  const height = canvas.clientHeight;
  if (drag.lights && !drag.pans) light(dx / height * Math.PI, dy / height * Math.PI);
  else turn((c) => (drag.pans ? pan(c, dx / height, dy / height) : orbit(c, dx / height * Math.PI, dy / height * Math.PI)));
});
for (const name of ["pointerup", "pointercancel"]) {
  canvas.addEventListener(name, () => { if (drag) { drag = null; change({}); } });
}
canvas.addEventListener("contextmenu", (event) => event.preventDefault());
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  turn((c) => zoom(c, Math.exp(event.deltaY * 0.001)));
}, { passive: false });

const slider = $("slider");
slider.addEventListener("pointerdown", (event) => slider.setPointerCapture(event.pointerId));
slider.addEventListener("pointermove", (event) => {
  if (!slider.hasPointerCapture(event.pointerId)) return;
  const box = canvas.getBoundingClientRect();
  view.move((event.clientX - box.left) / box.width);
});

// ---- controls

const SELECTS = ["buffer", "backend", "prefilter", "shading", "size"];
for (const id of SELECTS) $(id).addEventListener("change", () => change({ [id]: $(id).value || null }));
$("mode").addEventListener("change", () => change({ mode: $("mode").value.trim() || "auto:good" }));
$("split").addEventListener("change", () => splitWith($("split").value.trim() || null));
function splitWith(split) {
  view.isSplit = split !== null;
  // Only here: other lines are another size of the picture.
  $("second").hidden = $("compared").hidden = !view.isSplit;
  $("second").textContent = "";
  view.draw();
  change({ split });
}
const SHUTTER = ["open", "close", "weight", "readout", "direction", "anchor"];
for (const id of SHUTTER) $(id).addEventListener("change", shutterChanged);
function shutterChanged() {
  // What is the scene's stays its own: a drawn weight has no text that reads back.
  const own = (text, ofScene) => (text && text !== ofScene ? text : null);
  const [open, close, weight, duration, direction, anchor] = SHUTTER.map((id) => $(id).value.trim());
  change({ shutter: {
    open: Number(open), close: Number(close), weight: own(weight, scene?.weight),
    readout: own([Number(duration), direction, anchor].join(), scene?.readout),
  } });
}
$("frame").addEventListener("change", () => { const frame = Number($("frame").value); if (Number.isFinite(frame)) change({ frame }); });
$("time").addEventListener("input", () => change({ frame: Number($("time").value) }, true));
$("time").addEventListener("change", () => change({}));

// The values of the controls, except where someone writes.
function fill() {
  const put = (id, value) => { if (document.activeElement !== $(id)) $(id).value = value; };
  SELECTS.forEach((id) => { $(id).value = state[id] ?? ""; });
  put("mode", state.mode);
  put("split", state.split ?? "");
  put("open", state.shutter?.open ?? scene.open);
  put("close", state.shutter?.close ?? scene.close);
  put("weight", state.shutter?.weight ?? scene.weight);
  (state.shutter?.readout ?? scene.readout).split(",").forEach((value, i) => put(SHUTTER[3 + i], value));
  put("frame", state.frame);
  $("time").value = state.frame;
}

for (const id of ["ease", "speed"]) $(id).addEventListener("change", retime);

async function copy() {
  $("line").select();
  // Pages beyond the loopback address have no clipboard.
  const done = navigator.clipboard
    ? await navigator.clipboard.writeText($("line").value).then(() => true, () => false)
    : document.execCommand("copy");
  $("line").blur();
  say(done ? "camera copied" : "copy the line of the camera with Ctrl-C");
  if (!done) $("line").select();
}

// Takes another choice of a list, as a person does.
const next = (id, by = 1) => () => {
  const list = $(id);
  list.selectedIndex = (list.selectedIndex + by + list.options.length) % list.options.length;
  list.dispatchEvent(new Event("change"));
};
const ACTIONS = {
  "to-first": () => step(range().first), back: () => step(state.frame - 1), play, forward: () => step(state.frame + 1),
  "to-last": () => step(range().last), copy, reset: () => change({ camera: null }),
  "key-add": addKey, "key-drop": dropKey, "path-play": fly, "save-path": () => save("path"),
  "lights-drag": dragLights, "lights-reset": () => change({ lights: null }),
  "shutter-reset": () => change({ shutter: null }),
  "save-png": () => save("png"), "save-exr": () => save("exr"), "save-scene": () => save("scene"),
  "save-movie": film,
  "help-open": () => $("help").showModal(),
};
for (const [id, action] of Object.entries(ACTIONS)) $(id).addEventListener("click", action);

const edit = (id) => () => { $(id).focus(); $(id).select(); };
const KEYS = keys($("keys"), {
  act: ACTIONS, next, edit, zoom: (by) => turn((c) => zoom(c, by)),
  split: (by) => view.move(view.split + by), toggleSplit: () => splitWith(state.split === null ? "reference" : null),
});
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || $("help").open) return;
  const { target, key } = event;
  if (target.matches("input:not([type=range]), select, textarea")) {
    if (key === "Escape") target.blur();
    return;
  }
  if (target.type === "range" && /^(Arrow|Home|End|Page)/.test(key)) return;
  if (key === " " && target.matches("button")) return;
  const arrow = ARROWS[key];
  if (arrow && target === slider) view.move(view.split + 0.02 * arrow[0]);
  else if (arrow && draggingLights && !event.shiftKey) light(0.06 * arrow[0], 0.06 * arrow[1]);
  else if (arrow) turn((c) => (event.shiftKey ? pan(c, 0.03 * arrow[0], 0.03 * arrow[1]) : orbit(c, 0.06 * arrow[0], 0.06 * arrow[1])));
  else if (KEYS[key]) KEYS[key]();
  else return;
  event.preventDefault();
});

new ResizeObserver(() => change({})).observe($("stage"));
connect();
requestAnimationFrame(flush);
