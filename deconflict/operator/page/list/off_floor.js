// Robots that are off the floor, as an operator says: the dialog that says so, and the list from which they are put back.

import { Question, SOMEBODY, remembered } from "./acknowledge.js";
import { setText } from "./cards.js";
import { post } from "../floor/reading.js";
import { ago, clock, plural } from "../texts.js";

const $ = (id) => document.getElementById(id);
const question = new Question($("off-floor"), $("off-floor-who"), $("off-floor-refused"), "Not done");

// Asks whether a robot is off the floor.
export function askOffFloor({ uuid, name }, signedIn) {
  setText($("off-floor-what"), `${name} counts as nowhere: nobody is warned of it, and nothing waits for it. This holds until it is heard elsewhere or drives, or until somebody puts it back.`);
  question.ask(name, signedIn, (by) => mark(uuid, true, by));
}

function mark(uuid, isOff, name) { return post(`robots/${uuid}/off-floor`, { off_floor: isOff, name }); }

// Lists the robots that are off the floor, each with the button that puts it back, and those that came back by themselves.
export function listOffFloor(robots, nowS) {
  const off = robots.filter((robot) => robot.back_s === null), box = $("off-floor-list");
  box.hidden = !robots.length;
  setText($("off-floor-count"), `Off the floor: ${plural(off.length, "robot")}`);
  const key = JSON.stringify(robots.map((robot) => [robot.uuid, sentence(robot, nowS)]));
  if (box.dataset.key === key) return;
  const focused = document.activeElement?.dataset?.putBack;
  box.dataset.key = key;
  $("off-floor-lines").replaceChildren(...robots.map((robot) => line(robot, nowS)));
  if (focused) box.querySelector(`[data-put-back="${focused}"]`)?.focus();
}

function line(robot, nowS) {
  const item = document.createElement("li");
  item.append(Object.assign(document.createElement("strong"), { textContent: robot.name }), ` ${sentence(robot, nowS)} `);
  if (robot.back_s !== null) return item;
  const button = Object.assign(document.createElement("button"), { type: "button", textContent: "Put back" });
  button.dataset.putBack = robot.uuid;
  button.ariaLabel = `Put ${robot.name} back on the floor`;
  button.onclick = async () => {
    button.disabled = true;
    try { await mark(robot.uuid, false, remembered("name") ?? SOMEBODY); } catch (error) {
      button.disabled = false;
      item.append(` Not done: ${error.message}`);
    }
  };
  item.append(button);
  return item;
}

function sentence({ by, at_s: atS, still_heard: isHeard, back_s: backS }, nowS) {
  if (backS !== null) return `is back since ${clock(backS)}: it was heard elsewhere or drives. Off the floor, ${by} had said.`;
  return `is off the floor, says ${by} since ${clock(atS)}, ${ago(nowS - atS)}.${isHeard ? " It is still heard there." : ""}`;
}
