// Each vendor's colour and sign, and the table with the state of the vendors.

import { NOUNS, listed, plural, titled } from "../texts.js";

// Distinguishable with any of the common colour blindnesses (after Okabe and Ito), on light and on dark ground.
const COLOURS = {
  light: ["#0072b2", "#008a63", "#b3589a", "#8a6d00", "#3d4fb8", "#5c6670"],
  dark: ["#56b4e9", "#1fc795", "#e59acb", "#e6c229", "#9aa8ff", "#aab6c0"],
};
const MARKS = 4;
const RATE_SAMPLES = 6;
const NAMED = 3; // robots that a sentence names
const CLOCK_OFF_S = 0.5;
// The largest error of a forecast three seconds ahead, in four of five cases.
const ACCURACY = { A: "within 0.1 m", B: "within 0.25 m", C: "within 0.5 m", D: "within 1 m", E: "over 1 m off" };

const TRUST = { A: "very exact", B: "exact", C: "fair", D: "rough", E: "poor" };

const STANDARDS = { massrobotics: "MassRobotics", vda5050: "VDA 5050", iso21423: "ISO 21423" };

const CLOCK = { hour: "2-digit", minute: "2-digit" };

export class Vendors {
  constructor() {
    this.names = [];
    this.usual = new Map(); // by vendor of the site, what moves unless its model or UUID says otherwise
    this.kinds = new Map(); // by vendor, what its devices on the floors stand for
    this.healths = []; // the last `RATE_SAMPLES` healths of the service
  }

  // The site's vendors come first, so that each page gives a vendor the same colour.
  order(names) {
    this.names = [...names, ...this.names.filter((name) => !names.includes(name))];
  }

  // The vendor's number, which sets its colour and sign. A new vendor gets the next number.
  indexOf(name) {
    if (!this.names.includes(name)) this.names.push(name);
    return this.names.indexOf(name);
  }

  colour(name, theme) {
    const colours = COLOURS[theme];
    return colours[this.indexOf(name) % colours.length];
  }

  // What is on the floors. A new vendor gets the next number.
  note(robots) {
    for (const { vendor } of robots) this.indexOf(vendor);
    this.kinds = new Map([...Map.groupBy(robots, ({ vendor }) => vendor)].map(([vendor, own]) => [vendor, new Set(own.map(({ participant }) => participant))]));
  }

  // The signs of a vendor: one for each kind of its devices.
  signs(name) {
    const kinds = this.kinds.get(name) ?? new Set([this.usual.get(name) ?? "robot"]);
    return [...NOUNS.keys()].filter((kind) => kinds.has(kind)).map((kind) => ({ name, kind, text: kinds.size > 1 ? `${name}, ${NOUNS.get(kind)[1]}` : name }));
  }

  mark(name, kind) {
    return kind === "person" ? MARKS : this.indexOf(name) % MARKS;
  }

  // `counted` is what is on the floor, in words.
  legend(box, theme, draw, counted) {
    const signs = this.names.flatMap((name) => this.signs(name)), key = `${theme} ${counted} ${signs.map(({ kind, text }) => `${kind} ${text}`).join("\n")}`;
    if (box.dataset.key === key) return;
    box.dataset.key = key;
    const count = Object.assign(document.createElement("span"), { id: "counted", textContent: counted });
    box.replaceChildren(count, ...signs.map(({ name, kind, text }) => {
      const entry = document.createElement("span"), sign = document.createElement("canvas");
      sign.width = 48;
      sign.height = 36;
      draw(sign.getContext("2d"), this.colour(name, theme), this.mark(name, kind), kind);
      entry.append(sign, text);
      return entry;
    }));
  }

  // The table in words, and the table of figures.
  // `distrusted(vendor)` are the names of the robots that move otherwise than they announce.
  tables(words, figures, health, distrusted) {
    if (!health.vendors || this.healths.at(-1)?.at_s === health.at_s) return;
    this.healths = [...this.healths.slice(1 - RATE_SAMPLES), health];
    const vendors = Object.entries(health.vendors).map(([name, vendor]) => [name, { ...vendor, doubts: distrust(distrusted(name)) }, this.rate(name)]);
    words.replaceChildren(...vendors.map(([name, vendor, rate]) => row(name, inWords(vendor, rate))));
    figures.replaceChildren(...vendors.map(([name, vendor, rate]) => row(name, inFigures(vendor, rate))));
    [words, figures].forEach((body) => titled(body.closest("table")));
  }

  // What to mend, for the integrator: one line for each value that deviates, each robot that is compared with nobody, and
  // topics of brokers that are not heard.
  mending(list, health) {
    if (!health.vendors || list.dataset.at === `${health.at_s}`) return;
    list.dataset.at = `${health.at_s}`;
    const lines = [...Object.entries(health.vendors).flatMap(([name, vendor]) => toMend(name, vendor)), ...(health.brokers ?? [])];
    list.replaceChildren(...lines.map((textContent) => Object.assign(document.createElement("li"), { textContent })));
  }

  // The robots that are compared with nobody, by UUID: name, vendor, reason, and whether each is placed.
  notCompared() {
    const vendors = Object.entries(this.healths.at(-1)?.vendors ?? {});
    return new Map(vendors.flatMap(([vendor, { not_compared: robots = [] }]) => robots.map((robot) => [robot.uuid, { ...robot, vendor }])));
  }

  // The standards of a vendor's messages, in words; null until they are known.
  standards(name) {
    const languages = this.healths.at(-1)?.vendors[name]?.languages ?? [];
    return languages.map((language) => STANDARDS[language] ?? language).join(", ") || null;
  }

  // Messages a second over the last healths; null if there is only one, or if the service has restarted its count.
  rate(name) {
    const first = this.healths[0], last = this.healths.at(-1);
    const more = last.vendors[name].messages - (first.vendors[name]?.messages ?? NaN);
    return more >= 0 && last.at_s > first.at_s ? more / (last.at_s - first.at_s) : null;
  }
}

// What a shift leader needs to know of a vendor, and what to pass on to the integrator.
function inWords(vendor, rate) {
  const notes = [...(rate === 0 ? ["no messages arrive: call the integrator"] : []), ...vendor.doubts], passed = changes(vendor);
  if (vendor.rejected) passed.push("some messages can't be read");
  if (vendor.not_compared?.length) passed.push(`${plural(vendor.not_compared.length, "robot")} compared with nobody, listed below`);
  if (vendor.odd_values?.length) passed.push("values that deviate, listed below");
  if (clock(vendor) !== "right") passed.push(`clock ${clock(vendor)}`);
  const of = vendor.participants ?? {}, kinds = [...NOUNS].filter(([kind]) => of[kind]).map(([kind, [one, many]]) => plural(of[kind], one, many));
  const heard = vendor.silent ? [...kinds, `${vendor.robots - vendor.silent} heard`, `${vendor.silent} silent`] : [...(kinds.length ? kinds : [vendor.robots]), "all heard"];
  return [[heard.join(", "), vendor.silent > 0], [TRUST[vendor.grade] ?? "not yet known", vendor.grade >= "D"], [notes.join("; ") || "nothing", notes.length > 0, passed.length ? `For the integrator: ${passed.join("; ")}` : ""]];
}

function toMend(name, { odd_values: values = [], not_compared: robots = [] }) {
  return [
    ...robots.map((robot) => `${robot.name} is compared with nobody: ${robot.reason}`),
    ...values.map(({ rule, path, value, reading, nearest, robots: count }) => `${name}, ${plural(count, "robot")}: ${path}: sent ${value}, read: ${reading.replace(/^read as /, "")} (${rule})${nearest ? `; did you mean ${nearest}?` : ""}`),
  ];
}

function inFigures(vendor, rate) {
  return [
    [rate === null ? "…" : `${rate.toFixed(1)}/s`, rate === 0],
    [vendor.rejected ? `${vendor.deviations}, ${vendor.rejected} rejected` : `${vendor.deviations}`, vendor.rejected > 0],
    [clock(vendor), clock(vendor) !== "right"],
    [vendor.forecast_age_s === null ? "–" : `${vendor.forecast_age_s.toFixed(1)} s`, vendor.forecast_age_s > 3],
    [vendor.grade === null ? "not yet known" : `${vendor.grade}: ${ACCURACY[vendor.grade]}`, vendor.grade >= "D"],
    [[...changes(vendor), ...vendor.doubts].join("; ") || "nothing", vendor.flags.length + vendor.doubts.length > 0],
  ];
}

function clock(vendor) {
  const offset = -(vendor.clock_s ?? 0);
  return Math.abs(offset) < CLOCK_OFF_S ? "right" : `${Math.abs(offset).toFixed(1)} s ${offset > 0 ? "fast" : "slow"}`;
}

// What has changed of a vendor's messages.
function changes(vendor) {
  return vendor.flags.map((flag) => `${flag.words} since ${new Date(flag.since).toLocaleTimeString([], CLOCK)}`);
}

// Which robots move otherwise than they announce, as a list of one sentence, or none.
function distrust(names) {
  if (!names.length) return [];
  const who = listed([...names.slice(0, NAMED), ...(names.length > NAMED ? [`${names.length - NAMED} more`] : [])]);
  return [`${who} ${names.length === 1 ? "moves otherwise than it announces: warnings of it" : "move otherwise than they announce: warnings of them"} may be wrong`];
}

function row(name, cells) {
  const made = document.createElement("tr"), head = document.createElement("th");
  head.scope = "row";
  head.textContent = name;
  made.append(head, ...cells.map(([text, isBad, note]) => {
    const cell = Object.assign(document.createElement("td"), { textContent: text, className: isBad ? "bad" : "" });
    if (note) cell.append(Object.assign(document.createElement("p"), { className: "note", textContent: note }));
    return cell;
  }));
  return made;
}
