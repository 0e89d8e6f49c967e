// Each vendor's colour and sign, and the table with the state of the vendors.

// Distinguishable with any of the common colour blindnesses (after Okabe and Ito), on light and on dark ground.
const COLOURS = {
  light: ["#0072b2", "#008a63", "#b3589a", "#8a6d00", "#3d4fb8", "#5c6670"],
  dark: ["#56b4e9", "#1fc795", "#e59acb", "#e6c229", "#9aa8ff", "#aab6c0"],
};
const MARKS = 4;
const RATE_SAMPLES = 6;
const CLOCK_OFF_S = 0.5;
// The largest error of a forecast three seconds ahead, in four of five cases.
const ACCURACY = { A: "within 0.1 m", B: "within 0.25 m", C: "within 0.5 m", D: "within 1 m", E: "over 1 m off" };

const CLOCK = { hour: "2-digit", minute: "2-digit" };

export class Vendors {
  constructor() {
    this.names = [];
    this.people = new Set();
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

  mark(name) {
    return this.people.has(name) ? MARKS : this.indexOf(name) % MARKS;
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
    if (!health.vendors || this.healths.at(-1)?.at_s === health.at_s) return;
    this.healths = [...this.healths.slice(1 - RATE_SAMPLES), health];
    const rows = Object.entries(health.vendors).map(([name, vendor]) => {
      const row = document.createElement("tr"), head = document.createElement("th");
      head.scope = "row";
      head.textContent = name;
      row.append(head, ...this.cells(vendor, this.rate(name)));
      return row;
    });
    body.replaceChildren(...rows);
  }

  // Messages a second over the last healths; null if there is only one, or if the service has restarted its count.
  rate(name) {
    const first = this.healths[0], last = this.healths.at(-1);
    const more = last.vendors[name].messages - (first.vendors[name]?.messages ?? NaN);
    return more >= 0 && last.at_s > first.at_s ? more / (last.at_s - first.at_s) : null;
  }

  cells(vendor, rate) {
    const offset = -(vendor.clock_s ?? 0);
    const clock = Math.abs(offset) < CLOCK_OFF_S ? "right" : `${Math.abs(offset).toFixed(1)} s ${offset > 0 ? "fast" : "slow"}`;
    const cells = [
      [vendor.silent ? `${vendor.robots} (${vendor.silent} silent)` : `${vendor.robots}`, vendor.silent > 0],
      [rate === null ? "…" : `${rate.toFixed(1)}/s`, rate === 0],
      [vendor.rejected ? `${vendor.deviations}, ${vendor.rejected} rejected` : `${vendor.deviations}`, vendor.rejected > 0],
      [clock, clock !== "right"],
      [vendor.forecast_age_s === null ? "–" : `${vendor.forecast_age_s.toFixed(1)} s`, vendor.forecast_age_s > 3],
    ];
    const flags = vendor.flags.map((flag) => `${flag.words} since ${new Date(flag.since).toLocaleTimeString([], CLOCK)}`);
    if (vendor.distrusted) flags.push(`${vendor.distrusted} robots whose motion contradicts their forecasts`);
    cells.push(
      [vendor.grade === null ? "not yet known" : `${vendor.grade}: ${ACCURACY[vendor.grade]}`, vendor.grade >= "D"],
      [flags.join("; ") || "nothing", flags.length > 0],
    );
    return cells.map(([text, bad]) => {
      const cell = document.createElement("td");
      cell.textContent = text;
      cell.classList.toggle("bad", bad);
      return cell;
    });
  }
}
