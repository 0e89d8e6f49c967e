// The places where robots usually leave: draws a small door, and how many left there recently.

const DOOR_PX = [7, 11];

export function exits(map, scene) {
  const { pen, camera, ink, unit } = map, [wide, high] = DOOR_PX.map((px) => px * unit);
  for (const exit of scene.exits) {
    const x = camera.px(exit.x_m), y = camera.py(exit.y_m);
    pen.strokeStyle = ink["place-line"];
    pen.lineWidth = 1.5;
    pen.strokeRect(x - wide / 2, y - high / 2, wide, high);
    pen.beginPath();
    pen.moveTo(x, y);
    pen.lineTo(x + wide * 1.3, y);
    pen.stroke();
    if (camera.scale > 6) map.text(`exit, ${exit.robots} left`, x, y + high / 2 + 12 * unit, 11, ink.faint);
  }
}
