// The time slider: the moment that is shown, and the recorded floor at that moment, read one moment at a time.

import { robotsOf } from "./live.js";
import { clock } from "../texts.js";

const SPAN_MS = 10_000;
const STEP_S = 10;

export class Past {
  constructor(elements, nowS, changed) {
    Object.assign(this, elements);
    this.nowS = nowS;
    this.changed = changed;
    this.atS = null; // null while live
    this.floor = null;
    this.problem = "";
    this.moment.oninput = () => this.go(Number(this.moment.value));
    this.back.onclick = () => this.go((this.atS ?? this.nowS()) - STEP_S);
    this.forth.onclick = () => this.go((this.atS ?? this.nowS()) + STEP_S);
    this.live.onclick = () => this.goLive();
    this.readSpan();
    setInterval(() => this.readSpan(), SPAN_MS);
  }

  async readSpan() {
    try {
      const { from_s: fromS } = await (await fetch("recorded")).json();
      for (const control of [this.moment, this.back, this.forth]) control.disabled = fromS === null;
      if (fromS !== null) this.moment.min = Math.ceil(fromS);
    } catch { /* the live stream says that the service is lost */ }
    this.moment.max = Math.floor(this.nowS());
    if (this.atS === null) this.moment.value = this.moment.max;
  }

  go(atS) {
    if (atS >= this.nowS() - 1) return this.goLive();
    this.atS = Math.max(atS, Number(this.moment.min));
    this.moment.value = this.atS;
    this.showMoment();
    return this.readFloor();
  }

  goLive() {
    [this.atS, this.floor, this.problem] = [null, null, ""];
    this.moment.value = this.moment.max;
    this.showMoment();
    this.changed();
  }

  async readFloor() {
    if (this.reading) return;
    this.reading = true;
    while (this.atS !== null && this.floor?.atS !== this.atS) {
      const atS = this.atS;
      try {
        const answer = await fetch(`past?at_s=${atS}`);
        if (!answer.ok) throw new Error((await answer.json()).detail);
        const { floor, situations, advisories } = await answer.json();
        this.floor = { atS, robots: robotsOf(floor), situations, advisories };
        this.problem = "";
      } catch (error) {
        this.problem = error.message;
        break;
      }
    }
    this.reading = false;
    this.changed();
  }

  showMoment() {
    const text = this.atS === null ? "live" : clock(this.atS);
    this.shown.textContent = text;
    this.moment.setAttribute("aria-valuetext", text);
    this.live.setAttribute("aria-pressed", String(this.atS === null));
  }
}
