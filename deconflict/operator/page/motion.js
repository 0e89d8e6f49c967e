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

// How long the robot keeps moving after a time, seconds.
export function movesFor(robot, atS) {
  const { knots } = robot, last = knots.length - 4;
  let k = last;
  while (k > 0 && knots[k + 1] === knots[k - 3] && knots[k + 2] === knots[k - 2] && knots[k + 3] === knots[k - 1]) k -= 4;
  return k > 0 ? Math.max(robot.eventS + knots[k] - atS, 0) : 0;
}

// Adds the envelope at a pose to a path, in pixels.
export function envelope(path, camera, robot, pose, moreM = 0) {
  const cos = Math.cos(pose[2]) * camera.scale, sin = Math.sin(pose[2]) * camera.scale;
  const long = robot.lengthM / 2 + moreM, wide = robot.widthM / 2 + moreM, x = camera.px(pose[0]), y = camera.py(pose[1]);
  path.moveTo(x + long * cos - wide * sin, y - long * sin - wide * cos);
  path.lineTo(x - long * cos - wide * sin, y + long * sin - wide * cos);
  path.lineTo(x - long * cos + wide * sin, y + long * sin + wide * cos);
  path.lineTo(x + long * cos + wide * sin, y - long * sin + wide * cos);
  path.closePath();
}
