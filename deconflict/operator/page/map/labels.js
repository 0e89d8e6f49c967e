// Places labels beside what they name, where they cover no robot and no other label, and draws lines to what is far.

const GAP_PX = 7;
const RINGS = [0, 26, 52, 84, 124, 170]; // how far from the thing, pixels
const FAR = 1; // from this ring on, a line leads to the thing
const SIDES = [[0, -1], [0, 1], [1, 0], [-1, 0], [1, -1], [-1, -1], [1, 1], [-1, 1]];
const CELL_PX = 48;
export const BESIDE = 4; // how many places are tried for a label: those above, below and beside
export const AROUND = SIDES.length;
const ANYWHERE = RINGS.length * SIDES.length;

export class Labels {
  constructor() {
    this.lastSides = new Map(); // by id, where a label was in the last frame: it stays there while that is free
    this.begin({ width: 0, height: 0 }, 1);
  }

  begin(camera, unit) {
    Object.assign(this, { camera, unit, cells: new Map() });
    this.before = this.lastSides;
    this.lastSides = new Map();
  }

  // No label may cover this box from now on.
  take(box) {
    for (const key of cellsOf(box)) {
      if (!this.cells.has(key)) this.cells.set(key, []);
      this.cells.get(key).push(box);
    }
  }

  inSight({ left, right, top, bottom }) { return right > 0 && bottom > 0 && left < this.camera.width && top < this.camera.height; }

  // A free box of this size beside `thing`, or null, as if it is out of sight. With `must`, the least bad one. `line` is where a line
  // leads to, if it is far. `tries` is how many places are tried.
  place(id, thing, wide, high, { must = false, tries = ANYWHERE } = {}) {
    let best = null, least = Infinity;
    if (!must && !this.inSight(thing)) return null;
    for (const at of this.order(this.before.get(id), tries)) {
      const ring = Math.floor(at / SIDES.length), box = this.beside(thing, SIDES[at % SIDES.length], (GAP_PX + RINGS[ring]) * this.unit, wide, high);
      if (box.left < 0 || box.top < 0 || box.left + wide > this.camera.width || box.top + high > this.camera.height) continue;
      const covered = this.covered(box);
      if (covered < least) [best, least] = [{ ...box, at, isFar: ring >= FAR }, covered];
      if (!covered) break;
    }
    if (!best || (least && !must)) return null;
    this.lastSides.set(id, best.at);
    this.take(best);
    const x = (thing.left + thing.right) / 2, y = (thing.top + thing.bottom) / 2;
    return { ...best, line: best.isFar ? [clamp(x, best.left, best.left + wide), clamp(y, best.top, best.top + high), x, y] : null };
  }

  * order(last, count) {
    if (last < count) yield last;
    for (let at = 0; at < count; at += 1) if (at !== last) yield at;
  }

  beside({ left, right, top, bottom }, [dx, dy], gap, wide, high) {
    const x = dx ? (dx > 0 ? right + gap : left - gap - wide) : (left + right - wide) / 2;
    const y = dy ? (dy > 0 ? bottom + gap : top - gap - high) : (top + bottom - high) / 2;
    return { left: dx ? x : clamp(x, 2, this.camera.width - wide - 2), top: y, wide, high };
  }

  // How many square pixels of a box are taken already.
  covered(box) {
    let area = 0;
    for (const key of cellsOf(box)) {
      for (const other of this.cells.get(key) ?? []) {
        const wide = Math.min(box.left + box.wide, other.left + other.wide) - Math.max(box.left, other.left);
        const high = Math.min(box.top + box.high, other.top + other.high) - Math.max(box.top, other.top);
        if (wide > 0 && high > 0) area += wide * high;
      }
    }
    return area;
  }
}

// A line from a label to what it names; with an arrow's head for what a person should look at.
export function leader(pen, [x1, y1, x2, y2], colour, unit, hasHead) {
  pen.strokeStyle = pen.fillStyle = colour;
  pen.lineWidth = (hasHead ? 2 : 1.2) * unit;
  pen.beginPath();
  pen.moveTo(x1, y1);
  pen.lineTo(x2, y2);
  pen.stroke();
  if (!hasHead || Math.hypot(x2 - x1, y2 - y1) < 4 * unit) return;
  const angle = Math.atan2(y2 - y1, x2 - x1), size = 8 * unit;
  pen.beginPath();
  pen.moveTo(x2, y2);
  for (const turn of [2.7, -2.7]) pen.lineTo(x2 + size * Math.cos(angle + turn), y2 + size * Math.sin(angle + turn));
  pen.closePath();
  pen.fill();
}

function* cellsOf({ left, top, wide, high }) {
  for (let i = Math.floor(left / CELL_PX); i <= Math.floor((left + wide) / CELL_PX); i += 1)
    for (let j = Math.floor(top / CELL_PX); j <= Math.floor((top + high) / CELL_PX); j += 1) yield `${i},${j}`;
}

function clamp(value, low, high) { return Math.min(Math.max(value, low), Math.max(low, high)); }
