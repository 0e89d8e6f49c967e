// Draws the situations on the map: the outline of each, its label, and the lines to the robots of the selected one.

import { FADE_MS } from "../floor/feed.js";
import { inside } from "./places.js";
import { AROUND, leader } from "./labels.js";
import { SIGNS, countdown, isCalm, isOver, title } from "../texts.js";

const ANSWERED = 0.65; // opacity of what somebody takes care of
const OVER = 0.25; // opacity of what is over but may come back
const FONT = (unit) => `700 ${13 * unit}px system-ui, sans-serif`;
const SMALLEST_PX = 22; // an outline that would be smaller is drawn as a circle

export class SituationLayer {
  constructor(map) {
    this.map = map;
    this.labels = []; // those of this frame, with their boxes in pixels
  }

  // Draws what lies below the robots. Labels come later, once it is known what they must not cover.
  below(scene) {
    for (const situation of [...scene.situations].reverse()) this.outline(situation, scene.picked.has(situation.id));
    for (const situation of scene.situations) if (scene.picked.has(situation.id)) this.links(situation, scene);
    this.map.pen.globalAlpha = 1;
  }

  // Places the labels: the first of `scene.situations`, the most urgent, has the best place.
  placeLabels(scene) {
    this.labels = [];
    for (const situation of scene.situations) {
      const label = situation.endedMs || isOver(situation) ? null : this.label(situation, scene.listedS, scene.picked.has(situation.id));
      if (label) this.labels.push(label);
    }
  }

  above(scene) {
    for (const label of [...this.labels].reverse()) this.pill(label, scene.picked.has(label.id));
    this.map.pen.globalAlpha = 1;
  }

  // The id of the situation at a point of the canvas: its label, or else its outline.
  at(px, py, scene) {
    const label = this.labels.find(({ left, top, wide, high }) => px >= left && px <= left + wide && py >= top && py <= top + high);
    const [x, y] = this.map.camera.metres(px, py);
    return label?.id ?? scene.situations.find((situation) => !situation.endedMs && inside(situation.outline, x, y))?.id;
  }

  shape({ outline, location }) {
    const { camera, unit } = this.map, path = new Path2D(), [xs, ys] = [outline.map(([x]) => camera.px(x)), outline.map(([, y]) => camera.py(y))];
    let box = { left: Math.min(...xs), right: Math.max(...xs), top: Math.min(...ys), bottom: Math.max(...ys) };
    const r = (SMALLEST_PX * unit) / 2;
    if (!outline.length || box.right - box.left < 2 * r) {
      const [x, y] = [camera.px(location.x), camera.py(location.y)];
      path.arc(x, y, r, 0, 2 * Math.PI);
      box = { left: x - r, right: x + r, top: y - r, bottom: y + r };
    } else {
      outline.forEach((_, i) => path.lineTo(xs[i], ys[i]));
      path.closePath();
    }
    return { path, box };
  }

  outline(situation, picked) {
    const { pen, ink } = this.map, { path } = this.shape(situation), colour = ink[situation.severity], strength = strengthOf(situation);
    pen.fillStyle = pen.strokeStyle = colour;
    pen.globalAlpha = (picked ? 0.2 : 0.09) * strength;
    pen.fill(path);
    pen.globalAlpha = strength;
    pen.lineWidth = picked ? 4 : 2;
    pen.lineJoin = "round";
    pen.setLineDash(situation.acknowledgement ? [6, 5] : []);
    pen.stroke(path);
    pen.setLineDash([]);
  }

  links({ severity, robots, location }, scene) {
    const { pen, camera, ink } = this.map, here = new Map(scene.robots.map((robot) => [robot.uuid, robot]));
    pen.strokeStyle = ink[severity];
    pen.lineWidth = 1.5;
    pen.setLineDash([6, 4]);
    for (const robot of robots.map((uuid) => here.get(uuid)).filter(Boolean)) {
      pen.beginPath();
      pen.moveTo(camera.px(robot.x), camera.py(robot.y));
      pen.lineTo(camera.px(location.x), camera.py(location.y));
      pen.stroke();
    }
    pen.setLineDash([]);
  }

  // What nobody has to do anything about has a label only where there is room beside it.
  label(situation, nowS, picked) {
    const { pen, unit } = this.map, { id, severity, acknowledgement } = situation;
    const text = `${SIGNS[severity]} ${acknowledgement ? "✓ " : ""}${title(situation)}, ${countdown(situation, nowS)}`;
    pen.font = FONT(unit);
    const { box } = this.shape(situation);
    if (!this.map.labels.inSight(box)) return null;
    const place = this.map.labels.place(id, box, pen.measureText(text).width + 14 * unit, 21 * unit, (!isCalm(situation) && !isOver(situation)) || picked ? { must: true } : { tries: AROUND });
    return place && { id, text, severity, isAnswered: Boolean(acknowledgement), ...place };
  }

  pill({ text, severity, isAnswered, left, top, wide, high, line }, picked) {
    const { pen, ink, unit } = this.map, filled = picked || (!isAnswered && severity !== "caution");
    pen.globalAlpha = isAnswered ? ANSWERED : 1;
    if (line) leader(pen, line, ink[severity], unit, false);
    pen.beginPath();
    pen.roundRect(left, top, wide, high, 6 * unit);
    pen.fillStyle = filled ? ink[severity] : ink.halo;
    pen.fill();
    pen.strokeStyle = ink[severity];
    pen.lineWidth = 1.5;
    pen.stroke();
    pen.fillStyle = filled ? ink.halo : ink[severity];
    pen.font = FONT(unit);
    pen.textAlign = "center";
    pen.fillText(text, left + wide / 2, top + 15 * unit);
  }
}

function strengthOf(situation) {
  const { endedMs, acknowledgement } = situation;
  if (endedMs) return Math.max(0, 0.7 * (1 - (Date.now() - endedMs) / FADE_MS));
  return isOver(situation) ? OVER : acknowledgement ? ANSWERED : 1;
}
