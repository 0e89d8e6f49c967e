// Each vendor's colour and sign, and the table of how the vendors do.

// Told apart with any of the common colour blindnesses (after Okabe and Ito), for light and for dark ground.
const COLOURS = {
  light: ["#0072b2", "#008a63", "#b3589a", "#8a6d00", "#3d4fb8", "#5c6670"],
  dark: ["#56b4e9", "#1fc795", "#e59acb", "#e6c229", "#9aa8ff", "#aab6c0"],
};
const MARKS = 4;
const RATED_OVER = 6;
const CLOCK_OFF_S = 0.5;
// How far off a forecast three seconds ahead is, four times in five.
const TRUST = { A: "within 0.1 m", B: "within 0.25 m", C: "within 0.5 m", D: "within 1 m", E: "over 1 m off" };

const CLOCK = { hour: "2-digit", minute: "2-digit" };

export class Vendors {
  constructor() {
    this.names = [];
    this.people = new Set();
    this.told = [];
  }

  // The site's vendors come first, so that each page gives a vendor the same colour.
  order(names) {
    this.names = [...names, ...this.names.filter((name) => !names.includes(name))];
  }

  know(name) {
    if (!this.names.includes(name)) this.names.push(name);
    return this.names.indexOf(name);
  }

  colour(name, theme) {
    const colours = COLOURS[theme];
    return colours[this.know(name) % colours.length];
  }

  mark(name) {
    return this.people.has(name) ? MARKS : this.know(name) % MARKS;
  }

  legend(box, theme, draw) {
    const key = `${theme} ${this.names.join("\n")}`;
    if (box.dataset.key === key) return;
    box.dataset.key = key;
    box.replaceChildren(...this.names.map((name) => {
      const entry = document.createElement("span"), sign = document.createElement("canvas");
      sign.width = 48;
      sign.height = 36;
      draw(sign.getContext("2d"), this.colour(name, theme), this.mark(name));
      entry.append(sign, name);
      return entry;
    }));
  }

  table(body, health) {
    if (!health.vendors || this.told.at(-1)?.at_s === health.at_s) return;
    this.told = [...this.told.slice(1 - RATED_OVER), health];
    const rows = Object.entries(health.vendors).map(([name, one]) => {
      const row = document.createElement("tr"), head = document.createElement("th");
      head.scope = "row";
      head.textContent = name;
      row.append(head, ...this.cells(one, this.rate(name)));
      return row;
    });
    body.replaceChildren(...rows);
  }

  // Messages a second over the last tellings; null where there is only one, or the service began to count anew.
  rate(name) {
    const first = this.told[0], last = this.told.at(-1);
    const more = last.vendors[name].messages - (first.vendors[name]?.messages ?? NaN);
    return more >= 0 && last.at_s > first.at_s ? more / (last.at_s - first.at_s) : null;
  }

  cells(one, rate) {
    const offset = -(one.clock_s ?? 0);
    const clock = Math.abs(offset) < CLOCK_OFF_S ? "right" : `${Math.abs(offset).toFixed(1)} s ${offset > 0 ? "fast" : "slow"}`;
    const told = [
      [one.silent ? `${one.robots} (${one.silent} silent)` : `${one.robots}`, one.silent > 0],
      [rate === null ? "…" : `${rate.toFixed(1)}/s`, rate === 0],
      [one.rejected ? `${one.deviations}, ${one.rejected} rejected` : `${one.deviations}`, one.rejected > 0],
      [clock, clock !== "right"],
      [one.forecast_age_s === null ? "–" : `${one.forecast_age_s.toFixed(1)} s`, one.forecast_age_s > 3],
    ];
    const flags = one.flags.map((flag) => `${flag.words} since ${new Date(flag.since).toLocaleTimeString([], CLOCK)}`);
    if (one.distrusted) flags.push(`${one.distrusted} robots do other than they say`);
    told.push(
      [one.grade === null ? "not yet known" : `${one.grade}: ${TRUST[one.grade]}`, one.grade >= "D"],
      [flags.join("; ") || "nothing", flags.length > 0],
    );
    return told.map(([text, bad]) => {
      const cell = document.createElement("td");
      cell.textContent = text;
      cell.classList.toggle("bad", bad);
      return cell;
    });
  }
}
