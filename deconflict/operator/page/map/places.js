// Whether a robot is in a place, by the service's rule: a zone holds robots that touch it, a resource those with their
// centre inside.

const ZONES = new Set(["crossing", "aisle", "door"]);
const boxes = new WeakMap(); // the box around each polygon

export function holds(place, robot) {
  if (robot.x === undefined || !isNear(boxOf(place.polygon), robot)) return false;
  return ZONES.has(place.kind) ? touches(place.polygon, corners(robot)) : inside(place.polygon, robot.x, robot.y);
}

function boxOf(polygon) {
  if (!boxes.has(polygon)) {
    const xs = polygon.map(([x]) => x), ys = polygon.map(([, y]) => y);
    boxes.set(polygon, [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)]);
  }
  return boxes.get(polygon);
}

function isNear([left, bottom, right, top], { x, y, lengthM, widthM }) {
  const reach = (lengthM + widthM) / 2;
  return x > left - reach && x < right + reach && y > bottom - reach && y < top + reach;
}

function corners(robot) {
  const cos = Math.cos(robot.yaw), sin = Math.sin(robot.yaw), long = robot.lengthM / 2, wide = robot.widthM / 2;
  return [[long, wide], [-long, wide], [-long, -wide], [long, -wide]].map(([a, b]) => [robot.x + a * cos - b * sin, robot.y + a * sin + b * cos]);
}

function touches(p, q) {
  return p.some(([x, y]) => inside(q, x, y)) || q.some(([x, y]) => inside(p, x, y))
    || edges(p).some(([a, b]) => edges(q).some(([c, d]) => cross(a, b, c, d)));
}

function edges(polygon) {
  return polygon.map((point, i) => [point, polygon[(i + 1) % polygon.length]]);
}

function cross(a, b, c, d) {
  return side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0;
}

function side([ax, ay], [bx, by], [x, y]) {
  return (bx - ax) * (y - ay) - (by - ay) * (x - ax);
}

export function inside(polygon, x, y) {
  let within = false;
  for (let i = 0, j = polygon.length - 1; i < polygon.length; j = i, i += 1) {
    const [ax, ay] = polygon[i], [bx, by] = polygon[j];
    if (ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) within = !within;
  }
  return within;
}
