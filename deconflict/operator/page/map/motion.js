// The pose of a robot at a time by its forecast, and the corners of its envelope there.

// Writes x, y, yaw into `pose`: linear between knots, yaw along the shorter arc. The robot stands before the first knot and
// after the last.
export function poseAt(robot, atS, pose) {
  const { knots } = robot, after = atS - robot.eventS, last = knots.length - 4;
  let k = 0;
  while (k < last && knots[k + 4] <= after) k += 4;
  if (k >= last || after <= knots[k]) return set(pose, knots[k + 1], knots[k + 2], knots[k + 3]);
  const share = (after - knots[k]) / (knots[k + 4] - knots[k]);
  let turn = knots[k + 7] - knots[k + 3];
  turn -= 2 * Math.PI * Math.round(turn / (2 * Math.PI));
  return set(pose, mixed(knots[k + 1], knots[k + 5], share), mixed(knots[k + 2], knots[k + 6], share), knots[k + 3] + share * turn);
}

function mixed(a, b, share) { return a + share * (b - a); }

function set(pose, x, y, yaw) {
  pose[0] = x;
  pose[1] = y;
  pose[2] = yaw;
  return pose;
}

// Adds the robot and its trailers at a time to a path, in pixels.
export function train(path, camera, robot, atS, pose, moreM = 0) {
  envelope(path, camera, robot, poseAt(robot, atS, pose), moreM);
  for (const trailer of robot.trailers) envelope(path, camera, trailer, poseAt(trailer, atS, []), moreM);
}

// How long the robot keeps moving after a time, seconds.
export function movesFor(robot, atS) {
  const { knots } = robot, last = knots.length - 4;
  let k = last;
  while (k > 0 && knots[k + 1] === knots[k - 3] && knots[k + 2] === knots[k - 2] && knots[k + 3] === knots[k - 1]) k -= 4;
  return k > 0 ? Math.max(robot.eventS + knots[k] - atS, 0) : 0;
}

// Adds the outline at a pose to a path, in pixels. The parts of a shape may overlap: fill with "nonzero".
export function envelope(path, camera, robot, pose, moreM = 0) {
  const cos = Math.cos(pose[2]) * camera.scale, sin = Math.sin(pose[2]) * camera.scale;
  if (robot.shape?.length) return robot.shape.forEach((part) => outline(path, part, [camera.px(pose[0]), camera.py(pose[1])], [cos, sin], camera.scale, moreM));
  const long = robot.lengthM / 2 + moreM, wide = robot.widthM / 2 + moreM, x = camera.px(pose[0]), y = camera.py(pose[1]);
  path.moveTo(x + long * cos - wide * sin, y - long * sin - wide * cos);
  path.lineTo(x - long * cos - wide * sin, y + long * sin - wide * cos);
  path.lineTo(x - long * cos + wide * sin, y + long * sin + wide * cos);
  path.lineTo(x + long * cos + wide * sin, y - long * sin + wide * cos);
  path.closePath();
}

// Adds a part of a shape: [radius, x, y, ...], a circle if it has a radius, else the corners of a polygon.
function outline(path, [radius, ...corners], [x, y], [cos, sin], scale, moreM) {
  const at = (k) => [x + corners[k] * cos - corners[k + 1] * sin, y - corners[k] * sin - corners[k + 1] * cos];
  if (radius) {
    const [middleX, middleY] = at(0), pixels = (radius + moreM) * scale;
    path.moveTo(middleX + pixels, middleY);
    path.arc(middleX, middleY, pixels, 0, 2 * Math.PI);
    return;
  }
  for (let k = 0; k < corners.length; k += 2) path[k ? "lineTo" : "moveTo"](...at(k));
  path.closePath();
}
