// How many robots are in each place, by the service's rule: a zone holds robots that touch it, a resource those with their
// centre inside.

const ZONES = new Set(["crossing", "aisle", "door"]);
const CELL_M = 10;

// How many robots are in each place. Only those in the cells around a place are looked at.
export function countIn(places, robots) {
  const cells = Map.groupBy(robots.filter(({ x }) => x !== undefined), ({ x, y }) => cellAt(Math.floor(x / CELL_M), Math.floor(y / CELL_M)));
  const reach = Math.max(0, ...robots.map(({ lengthM, widthM }) => Math.hypot(lengthM, widthM) / 2));
  return places.map((place) => near(cells, place.polygon, reach).filter((robot) => holds(place, robot)).length);
}

function near(cells, polygon, reach) {
  const [xs, ys] = [0, 1].map((axis) => polygon.map((point) => point[axis])), cell = (metres) => Math.floor(metres / CELL_M), found = [];
  for (let i = cell(Math.min(...xs) - reach); i <= cell(Math.max(...xs) + reach); i += 1)
    for (let j = cell(Math.min(...ys) - reach); j <= cell(Math.max(...ys) + reach); j += 1) found.push(...cells.get(cellAt(i, j)) ?? []);
  return found;
}

function cellAt(i, j) { return i * 1e6 + j; }

function holds(place, robot) {
  return ZONES.has(place.kind) ? touches(place.polygon, corners(robot)) : inside(place.polygon, robot.x, robot.y);
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
