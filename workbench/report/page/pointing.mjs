// Pointing at the plan, and its keys.
import { WORD } from "./data.mjs";
import { $ } from "./dom.mjs";
import { neighbour, sourcesAt, targetAt } from "./storeys.mjs";
import { groundAt, moved } from "./view.mjs";
import { cellName, describe, roomName } from "./words.mjs";

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const KEYS = {
  "+": (state) => state.zoomHere(1.3),
  "=": (state) => state.zoomHere(1.3),
  "-": (state) => state.zoomHere(1 / 1.3),
  0: (state) => state.fit(),
  PageUp: (state) => state.show(state.storey + 1),
  PageDown: (state) => state.show(state.storey - 1),
  Escape: (state) => state.set({ target: null }),
};

/** A click at a pixel picks the view cell there, or asks about the target there. */
export function clickAt(state, px, py, asking) {
  const point = groundAt(state.view, px, py),
    found = sourcesAt(state, point);
  if (asking) state.set({ target: targetAt(state, point) });
  // Where view cells lie above each other, another click picks the next.
  else if (found.length) state.pick(found[(found.indexOf(state.cell) + 1) % found.length], { keepStorey: true });
}

/** What the tip says of the target and the view cells under the pointer; nothing where there are none. */
export function tipWords({ bake, cell, from, mode, room, verdicts }, target, under) {
  const lines = [],
    own = under.find((one) => from.includes(one));
  if (target) {
    const verdict = WORD[verdicts[target.kind][target.id]].toUpperCase();
    const whence = room < 0 ? `view cell ${cell}` : `room ${roomName(bake, room)}`;
    lines.push(describe(bake, target.kind, target.id), `${verdict} from ${whence}`);
  } else if (own !== undefined) lines.push(`${room < 0 ? "The view cell" : "A view cell of the room"}, ${cellName(bake, own)}`);
  if (under.length > 1 && mode === "pick")
    lines.push(`${under.length} view cells above each other: click again for the next`);
  return lines.join("\n");
}

function hoverAt(state, px, py) {
  const { view } = state,
    point = groundAt(view, px, py),
    target = targetAt(state, point),
    tip = $("tip");
  tip.textContent = tipWords(state, target, sourcesAt(state, point));
  tip.hidden = !tip.textContent;
  tip.style.left = `${px + 316 > view.width ? Math.max(4, px - tip.offsetWidth - 12) : px + 14}px`;
  tip.style.top = `${Math.min(py + 14, view.height - tip.offsetHeight - 4)}px`;
  state.set({ hover: target });
}

/** Acts on a key of the plan; returns whether it is one. */
export function pressKey(state, { key, shiftKey }) {
  const way = ARROWS[key];
  if (way && shiftKey) state.set({ view: moved(state.view, 60 * way[0], 60 * way[1]) });
  else if (way) state.pick(neighbour(state, way));
  else if (KEYS[key]) KEYS[key](state);
  else return false;
  return true;
}

/** Makes the plan's canvas obey pointer, wheel and keys. */
export function listenTo(canvas, state) {
  let drag = null;
  const place = (event) => {
    const rect = canvas.getBoundingClientRect();
    return [event.clientX - rect.left, event.clientY - rect.top];
  };
  canvas.onpointerdown = (event) => {
    if (event.button) return;
    drag = { x: event.clientX, y: event.clientY, moved: false };
    canvas.setPointerCapture(event.pointerId);
  };
  canvas.onpointermove = (event) => {
    if (!drag) {
      hoverAt(state, ...place(event));
      return;
    }
    const right = event.clientX - drag.x,
      down = event.clientY - drag.y;
    if (!drag.moved && Math.hypot(right, down) < 4) return;
    drag = { x: event.clientX, y: event.clientY, moved: true };
    $("tip").hidden = true;
    state.set({ view: moved(state.view, -right, down) });
  };
  canvas.onpointerup = (event) => {
    if (drag && !drag.moved) clickAt(state, ...place(event), state.mode === "inspect" || event.shiftKey);
    drag = null;
  };
  canvas.onpointercancel = () => {
    drag = null;
  };
  canvas.onpointerleave = () => {
    $("tip").hidden = true;
    state.set({ hover: null });
  };
  const wheel = (event) => {
    event.preventDefault();
    state.zoom(Math.exp(-Math.max(-200, Math.min(200, event.deltaY)) * 0.0022), ...place(event));
  };
  canvas.addEventListener("wheel", wheel, { passive: false });
  canvas.onkeydown = (event) => {
    if (!(event.ctrlKey || event.metaKey || event.altKey) && pressKey(state, event)) event.preventDefault();
  };
}
