// The summary of a shift, to read and to print: what was raised, what came of it, where, whose robots, who acknowledged what.

import { Turns, read } from "../floor/reading.js";
import { remember, remembered } from "../list/acknowledge.js";
import { inside } from "../map/places.js";
import { KINDS, SEVERITIES, SEVERITY, clock, plural, seconds, sentence, span, titled, what } from "../texts.js";

const MOST_ROWS = 10;
// Of codes whose sentences name a robot.
const ENDED = { left: "A robot left the floor", left_in_silence: "A robot is silent and has probably left", driven_through: "A robot is not there: another has driven through its place" };
const $ = (id) => document.getElementById(id);

export class Shift {
  // `places(floor)` have a name, x and y, `areas(floor)` a name and a polygon. `counted()` is what is on the floors now, in words, and
  // `nowS()` the service's time.
  constructor(floorName, places, areas, counted, nowS) {
    Object.assign(this, { floorName, places, areas, counted, nowS, turns: new Turns() });
    $("shift-hours").value = remembered("hours") ?? "8";
    $("shift-open").onclick = () => { $("shift").showModal(); this.read(); };
    $("shift-hours").onchange = () => { remember("hours", $("shift-hours").value); this.read(); };
    $("shift-print").onclick = () => window.print();
    $("shift-close").onclick = () => $("shift").close();
  }

  async read() {
    const turn = this.turns.next(), nowS = this.nowS(), fromS = Math.floor(nowS - 3600 * Number($("shift-hours").value));
    $("shift-body").textContent = "Reading…";
    try {
      const [{ situations, counts, complete }, { from_s: recordedS }, lostS] = await Promise.all([read(`shift?since_s=${fromS}`), read("recorded"), lost(fromS)]);
      if (!this.turns.isNewest(turn)) return;
      const all = situations.map(({ situation, first_kind: kind, worst_severity: severity, most_cost_s: lost }) => ({ ...situation, kind, severity, lost }));
      this.show(all, counts, { fromS, nowS, knownS: Math.min(recordedS ?? Infinity, ...all.map(({ raised_at: at }) => seconds(at)), nowS) }, complete, lostS);
    } catch (error) {
      if (this.turns.isNewest(turn)) $("shift-body").textContent = `The service does not answer: ${error.message}`;
    }
  }

  // `knownS` is the earliest time of which anything is known. `lostS` is what robots lost to each other; null if nobody knows.
  show(situations, counts, { fromS, nowS, knownS }, isComplete, lostS) {
    const acknowledged = answers(situations), open = situations.filter(({ state }) => state !== "cleared").length;
    const critical = situations.filter(({ severity }) => severity === "critical").length;
    const lead = `${document.title}, ${period(Math.max(fromS, knownS), nowS)}${knownS > fromS ? " (of the time before nothing is known)" : ""}: ${plural(sum(Object.values(counts), (count) => count), "situation")}, ${critical} of them critical at worst; ${open} still open, ${acknowledged.length} acknowledged. `
      + (lostS === null ? "" : `Robots and people lost ${span(lostS)} to each other: see “What it costs”. `) + `Heard now: ${this.counted()}.`;
    $("shift-body").replaceChildren(
      text("p", lead), text("p", `With people: ${withPeople(situations)}.`), ...(isComplete ? [] : [text("p", "Older ones are left out, as there are too many.")]),
      table("What was going on, by its worst severity", ["Kind", "Times", ...SEVERITIES.map((severity) => SEVERITY[severity]), "Lasted, median", "Expected loss"], kinds(situations, counts, nowS)),
      table("What came of it", ["Ended because", "Times"], tally(situations.filter(({ state }) => state === "cleared"), ({ cleared_code: code, cleared_because: because }) => [ENDED[code] ?? sentence(because)])),
      table("Where", ["Place", "Times", SEVERITY.critical], this.placeRows(situations)),
      table("Whose robots and people", ["Vendor", "Times"], tally(situations, ({ vendors }) => [...new Set(vendors)])),
      table("Who acknowledged what", ["At", "Who", "What", "Done about it"], acknowledged.map(({ name, reason, at, summary }) => [clock(seconds(at)).slice(0, 5), name, summary, reason])),
    );
  }

  // Where most was going on, what was critical first.
  placeRows(situations) {
    const rows = [...Map.groupBy(situations, (each) => this.place(each))].map(([place, all]) => [place, all.length, all.filter(({ severity }) => severity === "critical").length]);
    rows.sort((a, b) => b[2] - a[2] || b[1] - a[1]);
    const left = rows.splice(MOST_ROWS);
    if (left.length) rows.push([`${plural(left.length, "other place")}`, sum(left, ([, times]) => times), sum(left, ([, , critical]) => critical)]);
    return rows;
  }

  // The places that it is in, or else the areas, or else the nearest named place or column of its floor.
  place({ location }) {
    if (!location) return "No place";
    const floor = this.floorName(location.datum), places = this.places(location.datum), holds = ({ polygon }) => polygon && inside(polygon, location.x, location.y);
    const within = (places.some(holds) ? places : this.areas(location.datum)).filter(holds).map(({ name }) => name);
    if (within.length) return within.includes(floor) ? within.join(" and ") : `${within.join(" and ")}, ${floor}`;
    const near = places.map(({ name, x, y }) => [Math.hypot(x - location.x, y - location.y), name]).sort((a, b) => a[0] - b[0])[0];
    return near ? `Nearest to ${near[1]}, ${floor}` : floor;
  }
}

// The time that robots lost to each other; null if nobody knows.
async function lost(fromS) {
  try { return (await read(`losses?from_s=${fromS}`)).total.lost_s; } catch { return null; }
}

// The date only once if it is one day.
function period(fromS, untilS) {
  const [from, until] = [fromS, untilS].map((atS) => new Date(atS * 1000).toLocaleDateString([], { dateStyle: "medium" })), [begin, end] = [fromS, untilS].map((atS) => clock(atS).slice(0, 5));
  return from === until ? `${from}, ${begin} to ${end}` : `${from} ${begin} to ${until} ${end}`;
}

// Each acknowledgement, the oldest first.
function answers(situations) {
  const given = situations.filter(({ acknowledgement }) => acknowledgement).map((each) => ({ ...each.acknowledgement, summary: sentence(each.acknowledgement.summary || what(each)) }));
  return given.sort((a, b) => seconds(a.at) - seconds(b.at));
}

// How many situations are of robots and people, and of driven vehicles and people, and how many of them were critical at worst.
function withPeople(situations) {
  const found = [["robots", "robot"], ["driven vehicles", "driven"]].map(([words, kind]) => [words, situations.filter(({ participants = [] }) => participants.includes("person") && participants.includes(kind))]);
  return found.map(([words, those]) => `${plural(those.length, "situation")} of ${words} and people, ${those.filter(({ severity }) => severity === "critical").length} of them critical at worst`).join("; ");
}

// By the kind that each had when it was raised, as the service counts them.
function kinds(situations, counts, nowS) {
  const forS = ({ since_at: since, cleared_at: end }) => (end ? seconds(end) : nowS) - seconds(since);
  return [...Map.groupBy(situations, ({ kind }) => kind)].sort((a, b) => b[1].length - a[1].length).map(([kind, all]) => {
    const lasted = all.map(forS).sort((a, b) => a - b);
    return [KINDS[kind], counts[kind], ...SEVERITIES.map((severity) => all.filter((each) => each.severity === severity).length), span(lasted[Math.floor(lasted.length / 2)]), span(sum(all, ({ lost }) => lost))];
  });
}

// How often each key occurs, the most frequent first.
function tally(items, keysOf) {
  const counts = new Map();
  for (const key of items.flatMap(keysOf)) counts.set(key, (counts.get(key) ?? 0) + 1);
  const rows = [...counts].sort((a, b) => b[1] - a[1]), left = rows.splice(MOST_ROWS);
  return left.length ? [...rows, [plural(left.length, "other"), sum(left, ([, times]) => times)]] : rows;
}

export function table(title, heads, rows) {
  const box = document.createElement("section"), made = document.createElement("table"), head = made.createTHead().insertRow(), body = made.createTBody();
  for (const name of heads) head.append(Object.assign(document.createElement("th"), { scope: "col", textContent: name }));
  for (const row of rows) for (const [line, cells] of [[body.insertRow(), row]]) for (const cell of cells) line.insertCell().textContent = cell;
  titled(made);
  box.append(text("h3", title), rows.length ? made : text("p", "Nothing."));
  return box;
}

export function text(tag, textContent) { return Object.assign(document.createElement(tag), { textContent }); }

function sum(items, valueOf) { return items.reduce((total, item) => total + valueOf(item), 0); }
