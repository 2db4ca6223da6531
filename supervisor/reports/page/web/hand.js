// Manual driving: arrow keys or a held stick. The robot stands when both are released, or this page
// is hidden or closed.

const EVERY_MS = 100;
// Forward and left.
const KEYS = { ArrowUp: [1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1] };

export class Hand {
  constructor(orders, parent) {
    this.orders = orders;
    this.held = new Set();
    this.stick = [0, 0];
    this.waits = false;
    const pad = document.createElement("div");
    pad.id = "hand";
    pad.tabIndex = 0;
    pad.textContent = "Hold to drive, or use the arrow keys";
    parent.append(pad);
    const move = (event) => {
      const { left, top, width, height } = pad.getBoundingClientRect();
      this.stick = [1 - (2 * (event.clientY - top)) / height, 1 - (2 * (event.clientX - left)) / width];
    };
    const release = () => { this.stick = [0, 0]; this.held.clear(); };
    pad.addEventListener("pointerdown", (event) => {
      pad.setPointerCapture(event.pointerId);
      move(event);
    });
    pad.addEventListener("pointermove", (event) => { if (event.buttons) move(event); });
    for (const gone of ["pointerup", "pointercancel", "blur"]) pad.addEventListener(gone, release);
    document.addEventListener("visibilitychange", release);
    pad.addEventListener("keydown", (event) => {
      if (!KEYS[event.code]) return;
      event.preventDefault();
      this.held.add(event.code);
    });
    pad.addEventListener("keyup", (event) => this.held.delete(event.code));
    setInterval(() => this.push(), EVERY_MS);
  }

  async push() {
    let [ahead, left] = this.stick;
    for (const key of this.held) [ahead, left] = [ahead + KEYS[key][0], left + KEYS[key][1]];
    if (this.waits || Math.hypot(ahead, left) < 0.1) return;
    this.waits = true;
    const { ok, text } = await this.orders.net.ask({ order: "hand", ahead, left });
    this.waits = false;
    this.orders.say(ok ? "driven by hand" : `by hand: ${text}`, ok ? "good" : "bad");
  }
}
