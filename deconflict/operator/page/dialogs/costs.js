// What robots lose to each other: today against the same hours a week ago, by place, by pair of vendors and by hour. And what to
// change at the worst places, which stands for a shift.

import { table, text } from "./shift.js";
import { Turns, read } from "../floor/reading.js";
import { clock, span } from "../texts.js";

const HOUR_S = 3600, WEEK_S = 7 * 24 * HOUR_S, WORST = 5, OF_NO_PLACE = ["vendor", "clearance"];
const ACCURACY = "Sums by vendors, places and hours hold within a tenth, as measured on simulated floors.";
const $ = (id) => document.getElementById(id);

export class Costs {
  // `floorName(id)` names a floor, `look(floor, x, y)` shows a place on the map, `nowS()` is the service's time.
  constructor(floorName, look, nowS) {
    Object.assign(this, { floorName, look, nowS, turns: new Turns() });
    $("costs-open").onclick = () => { $("costs").showModal(); this.read(); };
    $("costs-print").onclick = () => window.print();
    $("costs-close").onclick = () => $("costs").close();
  }

  async read() {
    const turn = this.turns.next(), nowS = this.nowS(), todayS = new Date(nowS * 1000).setHours(0, 0, 0, 0) / 1000, wholeS = nowS - nowS % HOUR_S;
    $("costs-body").textContent = "Reading…";
    try {
      const [pairs, places, hours, before, suggested] = await Promise.all([
        ask("vendor,by", todayS, nowS), ask("floor,place,cell", todayS, nowS), ask("hour", todayS, nowS), ask("hour", todayS - WEEK_S, wholeS - WEEK_S), read("suggestions"),
      ]);
      if (!this.turns.isNewest(turn)) return;
      this.show(pairs, byPlace(places.rows), hours.rows, before.rows, nowS, suggested);
    } catch (error) {
      if (this.turns.isNewest(turn)) $("costs-body").textContent = `The service does not answer: ${error.message}`;
    }
  }

  show({ total, rows, currency }, places, hours, before, nowS, suggested) {
    const wholeS = nowS - nowS % HOUR_S;
    const money = (row) => (row.cost === null ? "" : `${row.cost.toFixed(2)} ${currency}`);
    const share = (row) => `${Math.round(100 * row.lost_s / total.lost_s)} %`, then = new Map(before.map((row) => [row.hour + WEEK_S, row.lost_s]));
    const heads = (...first) => [...first, "Lost", "Share", ...(total.cost === null ? [] : ["Cost"])];
    const cells = (row, ...first) => [...first, span(row.lost_s), share(row), ...(total.cost === null ? [] : [money(row)])];
    const whole = hours.filter(({ hour }) => hour < wholeS), priced = total.cost === null ? "" : `, which costs ${money(total)}`;
    const lead = `Today, until ${minute(nowS)}, robots and people lost ${span(total.lost_s)} to each other${priced}. ${compared(whole.reduce((sum, row) => sum + row.lost_s, 0), [...then.values()])} `
      + "A robot loses time while another one is in its way and it needs longer than by its plan. ";
    $("costs-body").replaceChildren(
      text("p", lead + warned(total) + ACCURACY),
      this.worstPlaces(places.slice(0, WORST), heads("Place", "Worst point"), cells),
      ...suggestions(suggested),
      table("The five worst pairs today", heads("Who lost time", "Who was in the way"), rows.slice(0, WORST).map((row) => cells(row, row.vendor, row.by))),
      table("Today by hour", [...heads("From"), "A week ago"], [...hours].sort((a, b) => a.hour - b.hour).map((row) => [...cells(row, minute(row.hour)), then.has(row.hour) ? span(then.get(row.hour)) : ""])),
    );
  }

  // Each place is a button that shows it on the map.
  worstPlaces(places, heads, cells) {
    const made = table("The five worst places today", heads, places.map((row) => cells(row, row.place || "Elsewhere", `${row.x.toFixed(0)}, ${row.y.toFixed(0)} m on ${this.floorName(row.floor)}`)));
    for (const [index, line] of [...made.querySelectorAll("tbody tr")].entries()) {
      const { floor, x, y } = places[index], button = Object.assign(document.createElement("button"), { type: "button", textContent: line.cells[0].textContent });
      button.onclick = () => { $("costs").close(); this.look(floor, x, y); };
      line.cells[0].replaceChildren(button);
    }
    return made;
  }
}

// Rows without lost time are of refused advice only.
async function ask(group, fromS, untilS) {
  const found = await read(`losses?group=${group}&from_s=${fromS}&until_s=${untilS}&limit=10000`);
  return { ...found, rows: found.rows.filter((row) => row.lost_s > 0) };
}

// A heading, and a list: the worst places with why and what pays, and what concerns no place. Or why there is nothing.
function suggestions({ places, suggestions: found, none_because: reason }) {
  const list = document.createElement("ol");
  const lines = [...places.map(({ text: sentences, best, evidence: of, since_s: sinceS }) => [`${sentences} These figures are of ${minute(of.from_s)} to ${minute(of.until_s)}; it stands since ${minute(sinceS)}.`, best?.check]), ...found.filter(({ kind }) => OF_NO_PLACE.includes(kind)).map((each) => [each.text, each.check])];
  list.append(...lines.map(([sentences, check]) => {
    const item = text("li", sentences);
    if (check) item.append(document.createElement("br"), "Simulate it with a log: ", text("code", check));
    return item;
  }));
  const lead = lines.length ? "The places where most was lost in the last shift and in this one; it stands for a shift. Savings are estimated from simulated floors: simulate a change before you make it." : `Nothing: ${reason || "no place stands out in the last shift or in this one"}.`;
  return [text("h3", "What to change"), text("p", lead), ...(lines.length ? [list] : [])];
}

// The places, worst first, each with its worst cell. Outside all places each cell counts as one.
function byPlace(rows) {
  const places = Map.groupBy(rows, ({ floor, place, cell }) => `${floor} ${place || cell}`);
  return [...places.values()].map((cells) => {
    const [{ floor, place, cell: [x, y] }] = cells, costs = cells.map(({ cost }) => cost).filter((cost) => cost !== null);
    return { floor, place, x, y, lost_s: sum(cells.map((row) => row.lost_s)), cost: costs.length ? sum(costs) : null };
  }).sort((a, b) => b.lost_s - a.lost_s);
}

function warned(total) {
  if (!total.losses) return "";
  const advised = total.advised_s ? `; for ${span(total.advised_s)} of them one of the two robots was advised, and for ${span(total.heeded_s)} it did as advised` : "";
  return `Of ${span(total.lost_s)} lost, ${span(total.warned_s)} were warned of before${advised}. `;
}

function compared(lostS, before) {
  if (!before.length) return "Of the same hours a week ago nothing is known.";
  const then = sum(before);
  return then ? `In its whole hours they lost ${span(lostS)}; a week ago ${span(then)} in the same hours.` : "In the same hours a week ago they lost nothing.";
}

function minute(atS) { return clock(atS).slice(0, 5); }

function sum(values) { return values.reduce((total, value) => total + value, 0); }
