// Numbers of the last frames: how long they took, and a small plot of them.

const FRAMES = 120;
// A longer pause is none between two frames of a motion [ms].
const PAUSE = 1000;

export class Numbers {
  constructor(canvas) {
    this.canvas = canvas;
    this.times = [];
    this.triangles = [];
  }

  /** A frame was drawn, so long after the one before [ms]. */
  add(ms, triangles) {
    if (ms <= 0 || ms > PAUSE) return;
    this.times = [...this.times.slice(1 - FRAMES), ms];
    this.triangles = [...this.triangles.slice(1 - FRAMES), triangles];
  }

  /** Frames a second of late, 0 for none. */
  get rate() {
    const last = this.times.slice(-20);
    const sum = last.reduce((a, b) => a + b, 0);
    return sum ? (1000 * last.length) / sum : 0;
  }

  /** Draw both; `target` [ms] as a line, if there is one. */
  draw(target, ink, quiet) {
    const context = this.canvas.getContext("2d");
    const { width, height } = this.canvas;
    context.clearRect(0, 0, width, height);
    context.font = "11px system-ui, sans-serif";
    const rows = [["ms a frame", this.times, "#0072b2", target], ["triangles", this.triangles, "#d55e00", 0]];
    rows.forEach(([name, values, colour, line], row) => {
      const most = Math.max(line * 1.2, 1e-9, ...values);
      const [low, high] = [(height / 2) * (row + 1) - 3, height / 2 - 18];
      const y = (value) => low - (high * value) / most;
      context.fillStyle = quiet;
      context.fillText(`${name}, at most ${Math.round(most).toLocaleString("en")}`, 0, low - high - 4);
      if (line) {
        context.fillStyle = ink;
        context.fillRect(0, y(line), width, 1);
      }
      context.strokeStyle = colour;
      context.lineWidth = 1.5;
      context.beginPath();
      values.forEach((value, k) => context.lineTo((k * width) / (FRAMES - 1), y(value)));
      context.stroke();
    });
  }
}
