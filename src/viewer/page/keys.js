// The keys of the page. One table serves the keyboard and the help.

// Rows: names of keys, what they do, and the action of each `event.key`. `act`: actions by the names of buttons;
// `edit`: goes to a field; `next`: takes the next choice of a list, or the one before; `zoom` and `split`: by how much.
const rows = ({ act, edit, next, zoom, split, toggleSplit }) => [
  ["drag, arrow keys", "orbit", {}],
  ["Shift-drag, Shift-arrow", "pan", {}],
  ["wheel, + and -", "zoom", { "+": () => zoom(0.9), "=": () => zoom(0.9), "-": () => zoom(1 / 0.9) }],
  ["0, c", "the scene's camera; copy the camera", { 0: act.reset, c: act.copy }],
  ["j, J", "the view as a key of the camera path; drop the last key", { j: act["key-add"], J: act["key-drop"] }],
  ["y, Y", "fly along the path, or stop; save it", { y: act["path-play"], Y: act["save-path"] }],
  ["h, H, q", "edit frames between keys, frames of easing; next speed", { h: edit("apart"), H: edit("ease"), q: next("speed") }],
  ["Ctrl-drag", "turn the lights", {}],
  ["l, L", "drags and arrow keys turn lights, or the camera again; the scene's lights", {
    l: act["lights-drag"], L: act["lights-reset"],
  }],
  ["Space", "play or stop", { " ": act.play }],
  [", and .", "one frame back or forward", { ",": act.back, ".": act.forward }],
  ["Home, End", "first and last frame", { Home: act["to-first"], End: act["to-last"] }],
  ["i, r", "edit frame, rate", { i: edit("frame"), r: edit("rate") }],
  ["m, S", "edit mode, split", { m: edit("mode"), S: edit("split") }],
  ["s", "split with the reference, or no split", { s: toggleSplit }],
  ["[ and ]", "move the split", { "[": () => split(-0.05), "]": () => split(0.05) }],
  ["b, B", "next and previous buffer", { b: next("buffer"), B: next("buffer", -1) }],
  ["t, T, w", "edit open, close, weight", { t: edit("open"), T: edit("close"), w: edit("weight") }],
  ["d, n, a", "edit readout; its next direction, anchor", { d: edit("readout"), n: next("direction"), a: next("anchor") }],
  ["o", "the scene's shutter", { o: act["shutter-reset"] }],
  ["k, f, g, z", "next backend, prefilter, shading, size", {
    k: next("backend"), f: next("prefilter"), g: next("shading"), z: next("size"),
  }],
  ["p, e, x", "save PNG, EXR, scene", { p: act["save-png"], e: act["save-exr"], x: act["save-scene"] }],
  ["v, V", "save a movie, or stop it; its next format", { v: act["save-movie"], V: next("movie-format") }],
  ["?, Esc", "this help; leave it, or a field", { "?": act["help-open"] }],
];

// The action of each key. Fills `list` with the help.
export function keys(list, parts) {
  const table = rows(parts);
  for (const [names, does] of table) {
    for (const [tag, text] of [["dt", names], ["dd", does]]) {
      list.append(Object.assign(document.createElement(tag), { textContent: text }));
    }
  }
  return Object.assign({}, ...table.map(([, , actions]) => actions));
}
