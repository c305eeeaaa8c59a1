// What keys, mouse and fingers ask for.

import { HURRY, TURN } from "./visitor.mjs";

const STEEP = 1.4;
const PER_PIXEL = 0.004;
// A finger that moved less far has clicked [pixels].
const STILL = 5;
const WAYS = {
  KeyW: ["forward", 1], KeyS: ["forward", -1], KeyA: ["right", -1], KeyD: ["right", 1],
  ArrowUp: ["forward", 1], ArrowDown: ["forward", -1], ArrowLeft: ["turn", 1], ArrowRight: ["turn", -1],
  PageUp: ["tilt", 1], PageDown: ["tilt", -1],
};

export class Keys {
  /** Listen to what is typed anywhere but into fields, and dragged on `canvas`; `asked(code)` hears of other keys,
   * `clicked(x, y)` of clicks and taps. */
  constructor(canvas, visitor, asked, clicked) {
    this.visitor = visitor;
    this.down = new Set();
    addEventListener("keydown", (event) => {
      if (event.target.closest?.("input, select, textarea") || event.ctrlKey || event.metaKey || event.altKey) return;
      if (WAYS[event.code] || event.code.startsWith("Shift")) {
        this.down.add(event.code);
        event.preventDefault();
      } else asked(event.code);
    });
    addEventListener("keyup", (event) => this.down.delete(event.code));
    addEventListener("blur", () => this.down.clear());
    // One finger looks, two walk.
    const held = new Map();
    let moved = 0;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      held.set(event.pointerId, [event.clientX, event.clientY]);
      moved = held.size > 1 ? Infinity : 0;
    });
    canvas.addEventListener("pointerup", (event) => moved < STILL && clicked(event.offsetX, event.offsetY));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => held.delete(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      const last = held.get(event.pointerId);
      if (!last) return;
      held.set(event.pointerId, [event.clientX, event.clientY]);
      moved += Math.abs(event.clientX - last[0]) + Math.abs(event.clientY - last[1]);
      if (held.size > 1) visitor.walk(0.016, (event.clientY - last[1]) * -0.4, (event.clientX - last[0]) * 0.4, visitor.speed);
      else this.look(event.clientX - last[0], event.clientY - last[1]);
    });
  }

  look(right, down) {
    this.visitor.yaw += right * PER_PIXEL;
    this.visitor.pitch = Math.max(-STEEP, Math.min(STEEP, this.visitor.pitch + down * PER_PIXEL));
  }

  /** Move the visitor for so many seconds; whether anything is asked for. */
  tick(seconds) {
    const sum = { forward: 0, right: 0, turn: 0, tilt: 0 };
    for (const code of this.down) if (WAYS[code]) sum[WAYS[code][0]] += WAYS[code][1];
    const hurry = [...this.down].some((code) => code.startsWith("Shift")) ? HURRY : 1;
    this.visitor.yaw += sum.turn * TURN * seconds;
    this.visitor.pitch = Math.max(-STEEP, Math.min(STEEP, this.visitor.pitch + sum.tilt * TURN * seconds));
    this.visitor.walk(seconds, sum.forward, sum.right, this.visitor.speed * hurry);
    return this.down.size > 0;
  }
}
