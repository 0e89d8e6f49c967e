// One robot in a box beside the map, and the robots of a floor as a table.

import { pageS } from "../floor/page_clock.js";
import { read } from "../floor/reading.js";
import { ago, likely, span, titled } from "../texts.js";

const LISTED = 200;
const READ_S = 2; // what a robot says of itself is asked for so often while its box is shown
const OLD_S = 6; // what was asked for longer ago is not of now
const STATES = {
  navigating: "drives", charging: "charges", waitingHumanEvent: "waits for a person", waitingExternalEvent: "waits for something around it",
  waitingInternalEvent: "busy with itself", manualOverride: "driven by hand",
}; // other states are words already
const MOVED_SHOWN_S = 3600;
const WALKS = "walks"; // of a person on foot, whose devices call it navigating, too
const FORECASTS = {
  path: "the path that it sends", order: "the order that it follows", velocity: "its speed and direction: it sends no path", destination: "its destination: it sends no path",
  stationary: "it stands and announces no way",
};

export class RobotBox {
  // `acts`: hide() when somebody closes it, follow() when somebody wants the map to stay with the robot, or no longer, and
  // takeOff() when somebody says that it is off the floor.
  constructor(box, { hide, follow, takeOff }) {
    this.box = box;
    this.facts = document.createElement("dl");
    this.title = document.createElement("strong");
    const close = Object.assign(document.createElement("button"), { type: "button", textContent: "Close", className: "close" });
    close.onclick = hide;
    this.follow = Object.assign(document.createElement("button"), { type: "button", textContent: "Follow", className: "follow" });
    this.follow.onclick = follow;
    this.takeOff = Object.assign(document.createElement("button"), { type: "button", textContent: "Off the floor…", className: "follow" });
    this.takeOff.onclick = takeOff;
    this.asked = this.answered = { uuid: null, atS: -Infinity };
    box.append(this.title, close, this.follow, this.takeOff, this.facts);
    box.addEventListener("keydown", ({ key }) => { if (key === "Escape") hide(); });
  }

  // `robot` or null; `view` has nowS, isPast, isTakenOff, isDistrusted, isFollowed, `standards` of its vendor, `notCompared`, why it is
  // compared with nobody, and whereIs(point) in words.
  show(robot, view) {
    this.box.hidden = !robot;
    if (!robot) return;
    this.follow.ariaPressed = String(view.isFollowed);
    this.takeOff.hidden = view.isPast;
    const doing = view.isPast ? [] : this.doing(robot.uuid, view);
    const rows = [["state", stateOf(robot, view.isTakenOff)], ...doing, ["last message", ago(view.nowS - robot.arrivalS)], ["forecast from", FORECASTS[robot.basis] ?? robot.basis], ["size", `${robot.lengthM} × ${robot.widthM} m`]];
    if (view.standards) rows.push(["standard", view.standards]);
    if (view.isDistrusted) rows.push(["trust", "moves otherwise than it announces"]);
    if (view.notCompared) rows.push(["not compared", view.notCompared]);
    if (robot.unidentified) rows.push(["identity", "not received yet: size and name are assumed"]);
    const key = JSON.stringify([robot.name, rows]);
    if (this.box.dataset.key === key) return;
    this.box.dataset.key = key;
    this.title.textContent = robot.name;
    this.facts.replaceChildren(...rows.flatMap(([term, fact]) => [["dt", term], ["dd", fact]]).map(([tag, textContent]) => Object.assign(document.createElement(tag), { textContent })));
  }

  // Where the robot goes, its battery and its load, as far as it says. Empty without an answer of now.
  doing(uuid, { nowS, whereIs }) {
    this.ask(uuid);
    const { answered } = this, isOfNow = answered.uuid === uuid && pageS() - answered.atS < OLD_S;
    const { destination, battery_pct: battery, run_time_left_s: leftS, load_used_pct: load, moved } = isOfNow ? answered.report : {};
    const rows = [];
    if (destination) rows.push(["goes to", `${whereIs(destination)}${expected(destination.expected_s, nowS)}`]);
    if (known(battery) || known(leftS)) rows.push(["battery", [known(battery) ? `${Math.round(battery)} %` : "", known(leftS) ? `lasts ${span(leftS)}` : ""].filter(Boolean).join(", ")]);
    if (moved && nowS - moved.at_s < MOVED_SHOWN_S) rows.push(["moved", `${moved.sentence}, ${ago(nowS - moved.at_s)}`]);
    if (known(load)) rows.push(["load", load ? `${Math.round(load)} % of what it can carry` : "none"]);
    return rows;
  }

  async ask(uuid) {
    const atS = pageS();
    if (this.asked.uuid === uuid && atS - this.asked.atS < READ_S) return;
    this.asked = { uuid, atS };
    try {
      const report = await read(`robots/${uuid}`);
      if (atS > this.answered.atS) this.answered = { uuid, atS, report };
    } catch { /* the last answer counts until it is old */ }
  }
}

function known(amount) { return amount !== null && amount !== undefined; }

function expected(atS, nowS) { return !known(atS) ? "" : atS > nowS ? `, in ${span(atS - nowS)}` : `, ${span(nowS - atS)} late`; }

// Fills the body of the table with the first `LISTED` robots by name, after those that are on no floor: `notCompared` has, by
// UUID, the robots that are compared with nobody.
export function fillTable(body, robots, nowS, isTakenOff, notCompared) {
  const rows = [...robots].sort((a, b) => (a.name < b.name ? -1 : 1)).slice(0, LISTED).map((robot) => {
    const row = document.createElement("tr"), head = Object.assign(document.createElement("th"), { scope: "row", textContent: `${robot.unidentified ? "? " : ""}${robot.name}` });
    const why = notCompared.get(robot.uuid)?.reason;
    row.append(head, ...[`${stateOf(robot, isTakenOff(robot))}${why ? `; not compared: ${why}` : ""}`, `${robot.knots[1].toFixed(1)}, ${robot.knots[2].toFixed(1)}`, ago(nowS - robot.arrivalS)].map((textContent) => Object.assign(document.createElement("td"), { textContent })));
    row.children[1].classList.toggle("why", !!why);
    return row;
  });
  const left = robots.length - rows.length;
  rows.unshift(...[...notCompared.values()].filter(({ placed }) => !placed).map(unplacedRow));
  if (left > 0) {
    const row = document.createElement("tr");
    row.append(Object.assign(document.createElement("td"), { colSpan: 4, textContent: `and ${left} more: find a robot by its name above` }));
    rows.push(row);
  }
  body.replaceChildren(...rows);
  titled(body.closest("table"));
}

function unplacedRow({ name, reason }) {
  const row = document.createElement("tr"), head = Object.assign(document.createElement("th"), { scope: "row", textContent: name });
  row.append(head, Object.assign(document.createElement("td"), { colSpan: 3, className: "why", textContent: `on no floor: ${reason}` }));
  return row;
}

function stateOf(robot, isTakenOff) {
  if (isTakenOff) return "not there: another has driven through its place";
  return robot.away === "silent" ? `silent${likely(robot)}` : robot.state === "navigating" && robot.participant === "person" ? WALKS : STATES[robot.state] ?? robot.state;
}
