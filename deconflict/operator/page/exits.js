// Where robots usually leave: a small door, and how many left there lately.

const DOOR_PX = [7, 11];

export function exits(map, scene) {
  const { pen, camera, ink, unit } = map, [wide, high] = DOOR_PX.map((px) => px * unit);
  for (const one of scene.exits) {
    const x = camera.px(one.x_m), y = camera.py(one.y_m);
    pen.strokeStyle = ink["place-line"];
    pen.lineWidth = 1.5;
    pen.strokeRect(x - wide / 2, y - high / 2, wide, high);
    pen.beginPath();
    pen.moveTo(x, y);
    pen.lineTo(x + wide * 1.3, y);
    pen.stroke();
    if (camera.scale > 6) map.text(`exit, ${one.robots} left`, x, y + high / 2 + 12 * unit, 11, ink.faint);
  }
}
