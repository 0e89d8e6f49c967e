// Draws one floor: what stands still, ribbons of motion, robots and situations.

import { GroundLayer } from "./ground_layer.js";
import { movesFor, poseAt, train } from "./motion.js";
import { AROUND, Labels, leader } from "./labels.js";
import { SituationLayer } from "./situation_layer.js";
import { ago, likely, order, short, span } from "../texts.js";

const BANDS = 5; // a ribbon fades in so many bands
const STEPS_S = { exact: 0.15, line: 0.5 };
const MOST_EXACT = 100; // with more robots, ribbons are drawn as lines of the robot's width
const MOST_LABELLED = 120; // with more robots, only involved and chosen robots have a label
const LABEL = { chosen: 4, first: 3, picked: 2, advised: 1, involved: 0, other: -1 }; // whose label is drawn first
const MOST_RIBBONS = 3000; // with more robots, there are no ribbons
const SYMBOL_PX = 12; // whoever would be smaller is drawn as a symbol of this size: it is seen on a wall, with the whole floor in view
const MOST_AVOIDED = 1500; // with more robots, labels may cover robots

export class FloorMap {
  constructor(canvas, camera, vendors) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
    this.camera = camera;
    this.vendors = vendors;
    this.pose = [0, 0, 0];
    this.labels = new Labels();
    this.ground = new GroundLayer(this);
    this.situations = new SituationLayer(this);
  }

  colours() {
    const style = getComputedStyle(document.documentElement);
    return Object.fromEntries(["ink", "faint", "floor", "grid", "place", "place-line", "rack", "wall", "machine", "halo", "critical", "warning", "caution", "accent"]
      .map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  }

  draw(scene) {
    const { pen, canvas, camera } = this, dense = window.devicePixelRatio || 1;
    const [width, height] = [Math.round(camera.width * dense), Math.round(camera.height * dense)];
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    pen.setTransform(dense, 0, 0, dense, 0, 0);
    this.unit = parseFloat(getComputedStyle(document.documentElement).fontSize) / 16;
    if (this.theme !== scene.theme) [this.theme, this.ink] = [scene.theme, this.colours()];
    pen.fillStyle = this.ink.floor;
    pen.fillRect(0, 0, camera.width, camera.height);
    const robots = this.within(scene); // before the places, which count them
    this.ground.below(scene);
    this.labels.begin(camera, this.unit);
    this.ground.keepClear(scene);
    if (robots.length <= MOST_AVOIDED) for (const robot of robots) this.labels.take(this.boxOf(robot));
    if (robots.length <= MOST_RIBBONS) this.ribbons(robots, scene);
    this.situations.below(scene);
    this.robots(robots, scene);
    this.situations.placeLabels(scene);
    this.names(robots, scene);
    this.ground.placeNames(scene);
    this.situations.above(scene);
    this.ground.gridNumbers();
    return robots.length;
  }

  within(scene) {
    const { camera, pose } = this, reach = 12, out = [];
    const [left, top] = camera.metres(0, 0), [right, bottom] = camera.metres(camera.width, camera.height);
    for (const robot of scene.robots) {
      poseAt(robot, scene.poseS(robot), pose);
      [robot.x, robot.y, robot.yaw] = pose;
      robot.atS = scene.poseS(robot);
      if (robot.x > left - reach && robot.x < right + reach && robot.y > bottom - reach && robot.y < top + reach) out.push(robot);
    }
    return out;
  }

  widthOf(text, size) {
    this.pen.font = `${size * this.unit}px system-ui, sans-serif`;
    return this.pen.measureText(text).width;
  }

  // The area that each envelope sweeps in the horizon, fainter for later times. Exact ribbons consist of bands that all begin
  // now and overlap; lines consist of bands one after the other. Overlaps within a band do not add up.
  ribbons(robots, scene) {
    const exact = robots.length <= MOST_EXACT, bands = new Map();
    for (const robot of robots) {
      const for_s = Math.min(movesFor(robot, scene.poseS(robot)), scene.horizonS);
      if (for_s <= 0 || robot.away) continue;
      for (let band = 0; band < BANDS; band += 1) {
        const before = (band * scene.horizonS) / BANDS, from = exact ? 0 : before, to = Math.min(((band + 1) * scene.horizonS) / BANDS, for_s);
        if (before >= to) break;
        const width = exact ? 0 : Math.max(1, Math.round((robot.widthM * this.camera.scale) / 2) * 2), key = `${robot.vendor} ${band} ${width}`;
        if (!bands.has(key)) bands.set(key, { path: new Path2D(), vendor: robot.vendor, band, width });
        this.swept(bands.get(key).path, robot, scene.poseS(robot), from, to, exact);
      }
    }
    for (const { path, vendor, band, width } of bands.values()) this.band(path, vendor, exact ? 0.11 : 0.4 * (1 - band / BANDS), width);
    this.pen.globalAlpha = 1;
  }

  swept(path, robot, nowS, from, to, exact) {
    const { camera, pose } = this, steps = Math.max(1, Math.ceil((to - from) / (exact ? STEPS_S.exact : STEPS_S.line)));
    for (let i = 0; i <= steps; i += 1) {
      const atS = nowS + from + ((to - from) * i) / steps;
      poseAt(robot, atS, pose);
      if (exact) train(path, camera, robot, atS, pose);
      else if (i === 0) path.moveTo(camera.px(pose[0]), camera.py(pose[1]));
      else path.lineTo(camera.px(pose[0]), camera.py(pose[1]));
    }
  }

  band(path, vendor, alpha, width) {
    const { pen } = this, colour = this.vendors.colour(vendor, this.theme);
    pen.globalAlpha = alpha;
    if (width) {
      pen.strokeStyle = colour;
      pen.lineWidth = width;
      pen.stroke(path);
    } else {
      pen.fillStyle = colour;
      pen.fill(path, "nonzero");
    }
  }

  robots(robots, scene) {
    const { pen, camera, ink } = this, by = new Map();
    for (const robot of robots) {
      const key = `${robot.vendor}\n${robot.participant}\n${robot.away || ""}`;
      if (!by.has(key)) by.set(key, []);
      by.get(key).push(robot);
    }
    for (const group of by.values()) {
      const [{ vendor, participant, away }] = group;
      pen.fillStyle = away === "silent" ? ink.faint : this.vendors.colour(vendor, this.theme);
      pen.globalAlpha = away === "silent" ? 0.35 : away ? 0.6 : 1;
      this.bodies(group, this.vendors.mark(vendor, participant), away);
    }
    for (const robot of robots) this.decorations(robot, scene);
  }

  // The names of robots: of all if there is room, else of those that are chosen, advised or involved, or not heard for long.
  names(robots, scene) {
    const { camera } = this, least = robots.length <= MOST_LABELLED && camera.scale > 14 ? LABEL.other : camera.scale > 10 ? LABEL.involved : LABEL.advised;
    const aged = new Set(robots.filter(isAged)), labelled = aged.size <= MOST_LABELLED ? aged : new Set();
    const named = robots.map((robot) => [rankOf(robot, scene), robot]).filter(([rank, robot]) => rank >= least || labelled.has(robot));
    for (const [rank, robot] of named.sort((a, b) => b[0] - a[0] || (a[1].uuid < b[1].uuid ? -1 : 1))) this.name(robot, scene, rank);
  }

  // What a robot covers on the canvas.
  boxOf(robot) {
    const { camera } = this, cos = Math.abs(Math.cos(robot.yaw)), sin = Math.abs(Math.sin(robot.yaw)), least = this.isSymbol(robot) ? (SYMBOL_PX * this.unit) / 2 : 0;
    const wide = Math.max(((robot.lengthM * cos + robot.widthM * sin) / 2) * camera.scale, least), high = Math.max(((robot.lengthM * sin + robot.widthM * cos) / 2) * camera.scale, least);
    const x = camera.px(robot.x), y = camera.py(robot.y);
    return { left: x - wide, right: x + wide, top: y - high, bottom: y + high, wide: 2 * wide, high: 2 * high };
  }

  // Whether an envelope would be so small that a symbol is drawn in its place.
  isSymbol({ lengthM, widthM }) { return Math.sqrt(lengthM * widthM) * this.camera.scale < SYMBOL_PX * this.unit; }

  // Adds a robot with its trailers to a path, `morePx` larger on each side: to scale, or the symbol of its kind.
  body(path, robot, morePx = 0) {
    const { camera } = this;
    if (this.isSymbol(robot)) symbol(path, robot.participant, camera.px(robot.x), camera.py(robot.y), SYMBOL_PX * this.unit + 2 * morePx);
    else train(path, camera, robot, robot.atS, this.pose, morePx / camera.scale);
  }

  // Draws robots of one vendor and kind in the colour that is set, with its sign.
  bodies(group, mark, away) {
    const { pen, camera, ink } = this, path = new Path2D(), signs = new Path2D();
    for (const robot of group) {
      this.body(path, robot);
      const size = this.isSymbol(robot) ? SYMBOL_PX * this.unit : Math.min(robot.widthM, robot.lengthM) * camera.scale;
      sign(signs, camera.px(robot.x), camera.py(robot.y), robot.yaw, size, mark);
    }
    pen.fill(path);
    pen.globalAlpha = 1;
    pen.setLineDash(away ? [4, 3] : []);
    pen.strokeStyle = away ? ink.ink : ink.halo;
    pen.lineWidth = away ? 1.5 : 1;
    pen.stroke(path);
    pen.setLineDash([]);
    pen.fillStyle = ink.halo;
    pen.fill(signs);
  }

  // A robot's outline if it is involved or chosen, and the circle of its uncertainty.
  decorations(robot, scene) {
    const { pen, camera, ink } = this, involved = scene.involved.get(robot.uuid), chosen = robot.uuid === scene.robot;
    if (involved || chosen) {
      const path = new Path2D();
      this.body(path, robot, 3);
      pen.strokeStyle = chosen ? ink.accent : ink[involved];
      pen.lineWidth = chosen || scene.highlighted.has(robot.uuid) ? 4 : 2.5;
      pen.stroke(path);
    }
    if (robot.doubtM > 0) {
      pen.beginPath();
      pen.arc(camera.px(robot.x), camera.py(robot.y), (robot.doubtM + robot.lengthM / 2) * camera.scale, 0, 2 * Math.PI);
      pen.strokeStyle = ink.faint;
      pen.setLineDash([2, 4]);
      pen.stroke();
      pen.setLineDash([]);
    }
  }

  // A robot's label beside it, where it covers nothing. An arrow leads from what it should do to the robot.
  name(robot, scene, rank) {
    const { pen, ink, unit } = this, isBold = rank > LABEL.other, size = isBold ? 13 : 11, action = scene.advised.get(robot.uuid);
    const heardS = scene.nowS - robot.arrivalS, silence = robot.away === "silent" ? ` silent ${span(heardS)}${likely(robot)}` : isAged(robot) ? `, heard ${ago(heardS)}` : "";
    const name = `${robot.unidentified ? "? " : ""}${short(robot.name, robot.vendor)}${silence}${action ? `: ${order(action)}` : ""}`;
    pen.font = `${isBold ? "600 " : ""}${size * unit}px system-ui, sans-serif`;
    const [wide, high] = [pen.measureText(name).width + 4 * unit, (size + 3) * unit], thing = this.boxOf(robot);
    const box = this.labels.place(robot.uuid, thing, wide, high, { must: rank >= LABEL.first, tries: action || rank >= LABEL.first ? undefined : AROUND });
    if (!box) return;
    const colour = action ? ink[scene.involved.get(robot.uuid)] ?? ink.ink : ink.faint;
    if (box.line || action) leader(pen, toEdge(box, thing), colour, unit, Boolean(action));
    this.text(name, box.left + wide / 2, box.top + size * unit, size, isBold ? ink.ink : ink.faint, isBold ? "600 " : "");
  }

  text(text, x, y, size, colour, weight = "") {
    const { pen, ink } = this;
    pen.font = `${weight}${size * this.unit}px system-ui, sans-serif`;
    pen.textAlign = "center";
    pen.lineWidth = 3 * this.unit;
    pen.lineJoin = "round";
    pen.strokeStyle = ink.halo;
    pen.strokeText(text, x, y);
    pen.fillStyle = colour;
    pen.fillText(text, x, y);
  }
}

export function swatch(pen, colour, mark, kind) {
  const path = new Path2D(), body = new Path2D();
  pen.fillStyle = colour;
  symbol(body, kind, 24, 18, 32);
  pen.fill(body);
  sign(path, 24, 18, 0, 26, mark);
  pen.fillStyle = document.documentElement.dataset.theme === "dark" ? "#0e141a" : "#ffffff";
  pen.fill(path);
}

// Adds the symbol of a kind of participant to a path: its shape tells the kind, also without colours. It turns the same way
// round as an envelope, so that nothing is left out where two of one path overlap.
function symbol(path, kind, x, y, size) {
  const half = size / 2;
  if (kind === "person") {
    path.moveTo(x + half, y);
    path.arc(x, y, half, 0, 2 * Math.PI, true);
  } else if (kind === "driven") {
    [[1.2, 0], [0, -1.2], [-1.2, 0], [0, 1.2]].forEach(([a, b], i) => path[i ? "lineTo" : "moveTo"](x + a * half, y + b * half));
    path.closePath();
  } else path.rect(x - half, y + half, size, -size);
}

// A vendor's sign, which points in the robot's heading: arrow, chevron, tee, notched arrow. The sign of a person is a dot.
function sign(path, x, y, yaw, size, mark) {
  const s = size * 0.34, cos = Math.cos(yaw) * s, sin = Math.sin(yaw) * s;
  const shapes = [
    [[1.1, 0], [-0.8, 0.9], [-0.8, -0.9]],
    [[1.1, 0], [-0.2, 1], [-0.9, 1], [0.3, 0], [-0.9, -1], [-0.2, -1]],
    [[1.1, 0.9], [1.1, -0.9], [0.5, -0.9], [0.5, -0.25], [-1.1, -0.25], [-1.1, 0.25], [0.5, 0.25], [0.5, 0.9]],
    [[1.1, 0], [0, 0.9], [0, 0.35], [-1.1, 0.35], [-1.1, -0.35], [0, -0.35], [0, -0.9]],
  ];
  if (mark === shapes.length) {
    path.moveTo(x + s * 0.8, y);
    path.arc(x, y, s * 0.8, 0, 2 * Math.PI);
    return;
  }
  shapes[mark].forEach(([a, b], i) => path[i ? "lineTo" : "moveTo"](x + a * cos - b * sin, y - a * sin - b * cos));
  path.closePath();
}

// From the nearest point of a label to the nearest point of a robot's box.
function toEdge({ left, top, wide, high }, thing) {
  const near = (value, low, top) => Math.min(Math.max(value, low), top), x = (thing.left + thing.right) / 2, y = (thing.top + thing.bottom) / 2;
  const from = [near(x, left, left + wide), near(y, top, top + high)];
  return [...from, near(from[0], thing.left, thing.right), near(from[1], thing.top, thing.bottom)];
}

// Whether it has not been heard for longer than robots usually are.
function isAged({ away }) { return away === "silent" || away === "quiet"; }

function rankOf({ uuid }, { robot, highlighted, first, advised, involved }) {
  if (uuid === robot) return LABEL.chosen;
  if (first.has(uuid)) return LABEL.first;
  if (highlighted.has(uuid)) return LABEL.picked;
  return advised.has(uuid) ? LABEL.advised : involved.has(uuid) ? LABEL.involved : LABEL.other;
}
