// Draws what stands still on a floor: its plan, grid, obstacles, places and marks with their names, exits and the heat map.

import { exits } from "./exits.js";
import { BESIDE } from "./labels.js";
import { countIn } from "./places.js";

const SMALL_PX = 60; // a place that is smaller is covered by no label
const AREA_NAME_AT = [[0, 0.5], [0, 0.8], [0, 0.2], [0.3, 0.5], [0.6, 0.5]]; // where the name of an area may stand, by length and breadth
const HATCH_PX = 8;
const EDGE_PX = 4; // of the numbers of the grid from the edge of the map

export class GroundLayer {
  constructor(map) {
    this.map = map;
    this.images = new Map();
  }

  below(scene) {
    if (scene.plan) this.plan(scene.plan);
    this.grid();
    this.obstacles(scene);
    this.keptClear(scene);
    this.places(scene);
    this.marks(scene);
    exits(this.map, scene);
    if (scene.heat) this.heat(scene);
  }

  // Keeps labels away from what they must not cover, and writes the names that stay where they are.
  keepClear(scene) {
    const { camera, unit, labels } = this.map;
    labels.take({ left: 0, top: 0, wide: camera.width, high: EDGE_PX + 12 * unit }); // the numbers of the grid
    labels.take({ left: 0, top: 0, wide: EDGE_PX + 24 * unit, high: camera.height });
    for (const { polygon } of scene.places) this.takeSmall(edges(polygon, camera));
    if (camera.scale > 3) this.fixedNames(scene);
  }

  // The image of the floor: its matrix maps pixels to metres, and the camera maps metres to the canvas.
  plan({ image: address, matrix }) {
    const { pen, camera } = this.map, { images } = this;
    if (!images.has(address)) images.set(address, Object.assign(new Image(), { src: address }));
    const image = images.get(address), scale = camera.scale;
    if (!image.complete || !image.naturalWidth) return;
    pen.save();
    pen.globalAlpha = this.map.theme === "dark" ? 0.35 : 0.6;
    pen.transform(scale, 0, 0, -scale, camera.px(0), camera.py(0));
    pen.transform(...matrix);
    pen.drawImage(image, 0, 0, image.naturalWidth, image.naturalHeight);
    pen.restore();
  }

  grid() {
    const { pen, camera, ink } = this.map;
    const every = [1, 5, 10, 50, 100].find((step) => step * camera.scale >= 28 * this.map.unit) ?? 500;
    const [left, top] = camera.metres(0, 0), [right, bottom] = camera.metres(camera.width, camera.height);
    pen.beginPath();
    for (let x = Math.ceil(left / every) * every; x <= right; x += every) line(pen, camera.px(x), 0, camera.px(x), camera.height);
    for (let y = Math.ceil(bottom / every) * every; y <= top; y += every) line(pen, 0, camera.py(y), camera.width, camera.py(y));
    pen.strokeStyle = ink.grid;
    pen.lineWidth = 1;
    pen.stroke();
  }

  // The coordinates of the grid, as sentences name them: x along the upper edge, y along the left edge.
  gridNumbers() {
    const { camera, ink, unit } = this.map, [left, top] = camera.metres(0, 0), [right, bottom] = camera.metres(camera.width, camera.height);
    const every = [1, 2, 5, 10, 20, 50, 100].find((step) => step * camera.scale >= 44 * unit) ?? 500;
    for (let x = Math.ceil(left / every) * every; x <= right; x += every) if (camera.px(x) > 70 * unit) this.map.text(`${x}`, camera.px(x), EDGE_PX + 10 * unit, 11, ink.faint);
    for (let y = Math.ceil(bottom / every) * every; y <= top; y += every) if (camera.py(y) > 30 * unit) this.map.text(`${y}`, EDGE_PX + 11 * unit, camera.py(y) + 4 * unit, 11, ink.faint);
    this.map.text("x, y in m", EDGE_PX + 28 * unit, EDGE_PX + 10 * unit, 10, ink.faint);
  }

  obstacles(scene) {
    const { pen, camera, ink } = this.map;
    pen.lineWidth = 1;
    for (const { kind, polygon } of scene.obstacles) {
      pen.beginPath();
      polygon.forEach(([x, y]) => pen.lineTo(camera.px(x), camera.py(y)));
      pen.closePath();
      pen.fillStyle = ink[kind];
      pen.fill();
      pen.strokeStyle = ink["place-line"];
      pen.stroke();
    }
  }

  // Ground onto which no robot is sent.
  keptClear(scene) {
    const { pen, camera, ink } = this.map;
    for (const { polygon } of scene.areas.filter((area) => area.keep_clear)) {
      pen.save();
      pen.beginPath();
      polygon.forEach(([x, y]) => pen.lineTo(camera.px(x), camera.py(y)));
      pen.closePath();
      hatch(pen, edges(polygon, camera), camera, ink.faint);
      pen.restore();
    }
  }

  places(scene) {
    const { pen, camera, ink } = this.map;
    const counts = countIn(scene.places, scene.robots);
    scene.places.forEach((place, i) => {
      pen.beginPath();
      place.polygon.forEach(([x, y]) => pen.lineTo(camera.px(x), camera.py(y)));
      pen.closePath();
      const contended = scene.contended.get(place.id);
      pen.fillStyle = ink.place;
      pen.fill();
      pen.strokeStyle = contended ? ink[contended.severity] : ink["place-line"];
      pen.lineWidth = contended ? 3 : 1.5;
      pen.stroke();
      place.taken = counts[i];
    });
  }

  // The names of places and of columns, where they cover nothing.
  placeNames(scene) {
    const { camera, ink } = this.map, tiny = camera.scale <= 3;
    for (const place of scene.places) {
      const contended = scene.contended.get(place.id), queue = contended?.queue_length && !contended.resources?.length ? `, ${contended.queue_length} will queue` : "";
      if (tiny && !contended) continue;
      this.beside(place.id, edges(place.polygon, camera), `${place.name || place.id} ${place.taken}/${place.capacity}${queue}`, 12, contended ? ink[contended.severity] : ink.faint, Boolean(contended && contended.severity !== "caution" && !contended.resources?.length));
    }
    if (!tiny) for (const { name, x, y } of scene.marks) this.beside(`mark ${name}`, { left: camera.px(x) - 4, right: camera.px(x) + 4, top: camera.py(y) - 4, bottom: camera.py(y) + 4 }, name, 11, ink.faint);
  }

  // Nothing may stand on a small place, or its label would be taken for that of its neighbour.
  takeSmall({ left, right, top, bottom }) {
    if (Math.max(right - left, bottom - top) < SMALL_PX * this.map.unit) this.map.labels.take({ left, top, wide: right - left, high: bottom - top });
  }

  // The names of areas and obstacles, which stay where they are, so other labels keep away from them.
  fixedNames(scene) {
    for (const area of scene.areas) this.areaName(area.name, edges(area.polygon, this.map.camera));
    for (const obstacle of scene.obstacles) this.nameWithin(obstacle.name, edges(obstacle.polygon, this.map.camera));
  }

  // At the western or southern end, whichever side is shorter, if there is room; elsewhere if something stands there.
  areaName(name, { left, right, top, bottom }) {
    const size = 12 * this.map.unit, width = this.map.widthOf(name, 12);
    if (width > 1.5 * (right - left) || size > bottom - top) return;
    const isWide = right - left > bottom - top, free = ([x, y]) => !this.map.labels.covered(nameBox(x, y, width, size));
    const spots = AREA_NAME_AT.map(([along, across]) => isWide
      ? [left + width / 2 + size + along * (right - left), bottom - across * (bottom - top) + size / 3] : [left + across * (right - left), bottom - size - along * (bottom - top)]);
    this.fixedName(name, ...(spots.find(free) ?? spots[0]), 12);
  }

  // In the middle, if the obstacle is as long as its name.
  nameWithin(name, { left, right, top, bottom }) {
    if (this.map.widthOf(name, 11) < right - left && 11 * this.map.unit < bottom - top) this.fixedName(name, (left + right) / 2, (top + bottom) / 2 + 4 * this.map.unit, 11);
  }

  fixedName(name, x, y, size) {
    this.map.labels.take(nameBox(x, y, this.map.widthOf(name, size), size * this.map.unit));
    this.map.text(name, x, y, size, this.map.ink.faint);
  }

  beside(id, thing, text, size, colour, must = false) {
    const wide = this.map.widthOf(text, size), high = size * this.map.unit, box = this.map.labels.place(id, thing, wide, high, { must, tries: BESIDE });
    if (box) this.map.text(text, box.left + wide / 2, box.top + high * 0.85, size, colour);
  }

  marks(scene) {
    const { pen, camera, ink } = this.map;
    for (const mark of scene.marks) {
      const x = camera.px(mark.x), y = camera.py(mark.y);
      pen.strokeStyle = ink["place-line"];
      pen.lineWidth = 1.5;
      pen.beginPath();
      line(pen, x - 5, y, x + 5, y);
      line(pen, x, y - 5, x, y + 5);
      pen.stroke();
    }
  }

  heat(scene) {
    const { pen, camera } = this.map, { cell_m: cell, floors } = scene.heat, cells = floors[scene.floor] ?? [];
    const most = Math.max(1, ...cells.map((cellCount) => cellCount[2]));
    for (const [x, y, count] of cells) {
      pen.fillStyle = this.map.theme === "dark" ? "#ff8a5c" : "#d1380a";
      pen.globalAlpha = 0.12 + 0.55 * (count / most);
      pen.fillRect(camera.px(x), camera.py(y + cell), cell * camera.scale, cell * camera.scale);
    }
    pen.globalAlpha = 1;
  }
}

// The box around a polygon, in pixels.
function edges(polygon, camera) {
  const xs = polygon.map(([x]) => camera.px(x)), ys = polygon.map(([, y]) => camera.py(y));
  return { left: Math.min(...xs), right: Math.max(...xs), top: Math.min(...ys), bottom: Math.max(...ys) };
}

// What a text covers that stands around x, on the line y.
function nameBox(x, y, wide, high) { return { left: x - wide / 2, top: y - 0.85 * high, wide, high }; }

function line(pen, x1, y1, x2, y2) {
  pen.moveTo(x1, y1);
  pen.lineTo(x2, y2);
}

// Outlines the path of the pen and fills it with slanted lines within a width and height: told from places without colours.
export function hatch(pen, { left, right, top, bottom }, { width, height }, colour) {
  pen.strokeStyle = colour;
  pen.lineWidth = 1;
  pen.stroke();
  pen.clip();
  pen.beginPath();
  const high = Math.min(bottom, height), low = Math.max(top, 0);
  const first = Math.ceil((Math.max(left, 0) + low) / HATCH_PX) * HATCH_PX;
  for (let sum = first; sum <= Math.min(right, width) + high; sum += HATCH_PX) line(pen, sum - high, high, sum - low, low);
  pen.stroke();
}

// The sign of such ground in the legend.
export function hatchSign(canvas, colour) {
  const pen = canvas.getContext("2d"), { width, height } = canvas;
  pen.reset();
  pen.rect(1, 1, width - 2, height - 2);
  hatch(pen, { left: 0, right: width, top: 0, bottom: height }, { width, height }, colour);
}
