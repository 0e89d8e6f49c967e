// Maps metres on a floor (y upwards) to pixels on the canvas. Moved by pointer, wheel and keys.

const SMALLEST = 0.5, LARGEST = 400; // pixels for a metre
const FILLED = 0.94; // by what is fitted, of the map

export class Camera {
  // `changed` gets "moved" or "zoomed" if somebody did it by hand.
  constructor(canvas, changed, pressed) {
    this.canvas = canvas;
    this.changed = changed;
    this.pressed = pressed;
    this.x = this.y = 0;
    this.scale = 20;
    this.fingers = new Map();
    this.measure();
    new ResizeObserver(() => this.measure()).observe(canvas);
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => this.up(event));
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY / 500), event.offsetX, event.offsetY);
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  // To ask the browser for the size at each point would make it lay out the page again and again.
  measure() { [this.width, this.height] = [this.canvas.clientWidth, this.canvas.clientHeight]; }
  px(x) { return this.width / 2 + (x - this.x) * this.scale; }
  py(y) { return this.height / 2 - (y - this.y) * this.scale; }
  metres(px, py) { return [this.x + (px - this.width / 2) / this.scale, this.y - (py - this.height / 2) / this.scale]; }

  fit([left, bottom, right, top]) {
    this.x = (left + right) / 2;
    this.y = (bottom + top) / 2;
    this.scale = this.bounded(FILLED * Math.min(this.width / Math.max(right - left, 4), this.height / Math.max(top - bottom, 4)));
    this.changed();
  }

  // The width and height of the most that can be fitted.
  get mostM() { return [this.width, this.height].map((px) => (FILLED * px) / SMALLEST); }

  centreOn(x, y) {
    [this.x, this.y] = [x, y];
    this.changed();
  }

  zoom(by, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.metres(px, py);
    this.scale = this.bounded(this.scale * by);
    this.x = x - (px - this.width / 2) / this.scale;
    this.y = y + (py - this.height / 2) / this.scale;
    this.changed("zoomed");
  }

  bounded(scale) { return Math.min(Math.max(scale, SMALLEST), LARGEST); }

  down(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
    this.travelled = 0;
  }

  move(event) {
    const before = this.fingers.get(event.pointerId);
    if (!before) return;
    const here = [event.offsetX, event.offsetY], spread = this.spread();
    this.fingers.set(event.pointerId, here);
    const [dx, dy] = [(here[0] - before[0]) / this.fingers.size, (here[1] - before[1]) / this.fingers.size];
    this.travelled += Math.hypot(dx, dy);
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
    if (spread) this.zoom(this.spread() / spread, ...here);
    this.changed("moved");
  }

  up(event) {
    if (event.type === "pointerup" && this.fingers.has(event.pointerId) && this.travelled < 5) this.pressed(event.offsetX, event.offsetY);
    this.fingers.delete(event.pointerId);
  }

  spread() {
    if (this.fingers.size !== 2) return 0;
    const [a, b] = this.fingers.values();
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
  }

  key(event) {
    const step = 60 / this.scale;
    const moves = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] }[event.key];
    if (moves) {
      this.centreOn(this.x + moves[0], this.y + moves[1]);
      this.changed("moved");
    } else if (event.key === "+" || event.key === "=") this.zoom(1.25);
    else if (event.key === "-") this.zoom(0.8);
    else return;
    event.preventDefault();
  }
}
