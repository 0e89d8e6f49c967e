// Which time is shown: now, or a moment in the past. Nothing else knows: whatever is drawn is read from here, with its time.

import { liveStatus } from "./live_status.js";
import { robotsOf } from "./live.js";
import { Turns } from "./reading.js";
import { ago, clock } from "../texts.js";

const FROZEN = ["lost", "stale"]; // states in which the live floor is drawn as it was at its last tick

export class Shown {
  constructor(live, feed) {
    Object.assign(this, { live, feed });
    this.faults = new Map(); // by part of the page, why it can't be shown: it stands still
    this.turns = new Turns(); // each choice of a time is one
    this.choose(null);
  }

  // Chooses a moment to show, null for now. A moment is shown once its floor has been read, until then what was shown before.
  choose(chosenS) {
    Object.assign(this, { chosenS, problem: "" });
    if (chosenS === null) this.recorded = null;
    return this.turns.next();
  }

  // The turn of the present choice. Whoever asks the service for something of a time takes it along.
  get turn() { return this.turns.newest; }

  // Takes the recorded floor that was asked for, or why there is none, if nothing else has been chosen since.
  take(turn, { floor, situations, advisories }) {
    if (this.turns.isNewest(turn)) this.recorded = { turn, atS: floor.now_s, robots: robotsOf(floor), situations, advisories };
  }

  fail(turn, problem) {
    if (this.turns.isNewest(turn)) this.problem = problem;
  }

  // Whether that choice is what is shown.
  isOf(turn) { return this.turns.isNewest(turn) && (this.chosenS === null || this.recorded?.turn === turn); }
  get isReading() { return !this.isOf(this.turn) && !this.problem; }
  get isPast() { return this.recorded !== null; }
  get atS() { return this.recorded?.atS ?? (FROZEN.includes(liveStatus(this.live, this.feed)[0]) ? this.live.tickS : this.live.nowS()); }
  get robots() { return (this.recorded ?? this.live).robots; }
  get situations() { return this.recorded?.situations ?? [...this.feed.situations.values()]; }
  get advisories() { return this.recorded?.advisories ?? [...this.feed.advisories.values()]; }
  get advice() { return this.isPast ? [] : [...this.feed.advice.values()]; }
  get ended() { return this.isPast ? [] : [...this.feed.ended.values()]; }
  get health() { return this.isPast ? {} : this.live.health; } // the service says nothing of the past

  // The name of the state that is shown, and a sentence.
  get status() {
    if (this.faults.size) return ["stale", `This page can't show what the service says. Load it anew; if that does not help, report: ${[...this.faults.values()].join("; ")}`];
    const [state, sentence] = this.recorded ? ["past", `Showing ${clock(this.atS)}, ${ago(this.live.nowS() - this.atS)}`] : liveStatus(this.live, this.feed);
    if (this.isReading) return [state, `Reading ${clock(this.chosenS)}… ${sentence}`];
    return [state, this.problem ? `${clock(this.chosenS)} can't be shown: ${this.problem}. ${sentence}` : sentence];
  }

  // The time beside the slider.
  get time() {
    if (this.isReading) return `reading ${clock(this.chosenS)}`;
    return this.recorded ? clock(this.atS) : this.status[0] === "live" ? "live" : clock(this.atS);
  }
}
