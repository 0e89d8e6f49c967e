// The time slider: which moment is chosen. Recorded floors are read one at a time.

import { pageS } from "./page_clock.js";
import { read } from "./reading.js";

const SPAN_MS = 10_000;
const STEP_S = 10;
const LONG_S = 5; // an answer that takes longer is given up if another moment is chosen, one that takes much longer is lost
const LOST_MS = 60_000;
const RETRY_MS = 1000;
const MOST_LOST = 5; // after so many lost answers in a row the page says why the moment can't be shown

export class Past {
  // `changed` is called when another time is shown.
  constructor(elements, shown, changed) {
    Object.assign(this, { ...elements, shown, changed, reading: null });
    this.moment.oninput = () => this.go(Number(this.moment.value));
    this.back.onclick = () => this.go((shown.chosenS ?? shown.live.nowS()) - STEP_S);
    this.forth.onclick = () => this.go((shown.chosenS ?? shown.live.nowS()) + STEP_S);
    this.now.onclick = () => this.goLive();
    this.readSpan();
    setInterval(() => this.readSpan(), SPAN_MS);
  }

  async readSpan() {
    try {
      const { from_s: fromS } = await read("recorded");
      for (const control of [this.moment, this.back, this.forth]) control.disabled = fromS === null;
      if (fromS !== null) this.moment.min = Math.ceil(fromS);
    } catch { /* the live stream says that the service is lost */ }
    this.moment.max = Math.floor(this.shown.live.nowS());
    if (this.shown.chosenS === null) this.moment.value = this.moment.max;
  }

  go(atS) {
    if (atS >= this.shown.live.nowS() - 1) return this.goLive();
    this.shown.choose(Math.max(atS, Number(this.moment.min)));
    this.moment.value = this.shown.chosenS;
    if (pageS() - this.askedS > LONG_S) this.reading?.abort();
    this.say();
    return this.readMoments();
  }

  goLive() {
    this.shown.choose(null);
    this.reading?.abort();
    this.moment.value = this.moment.max;
    this.changed();
  }

  // Reads the moment that is chosen, again if its answer is lost, and then the one that has been chosen meanwhile: the service reads
  // one after the other, too.
  async readMoments() {
    if (this.reading) return;
    for (let [lost, lostTurn] = [0, null]; this.shown.isReading; ) {
      const { turn, chosenS } = this.shown;
      [this.reading, this.askedS] = [new AbortController(), pageS()];
      try {
        this.shown.take(turn, await read(`past?at_s=${chosenS}`, AbortSignal.any([this.reading.signal, AbortSignal.timeout(LOST_MS)])));
      } catch (error) {
        [lost, lostTurn] = [turn === lostTurn ? lost + 1 : 1, turn];
        if (isLost(error) && lost < MOST_LOST) await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
        else this.shown.fail(turn, error.message);
      }
    }
    this.reading = null;
    this.changed();
  }

  say() {
    const { time, chosenS } = this.shown, isPressed = String(chosenS === null);
    if (this.now.ariaPressed !== isPressed) this.now.ariaPressed = isPressed;
    if (this.time.textContent !== time) this.time.textContent = this.moment.ariaValueText = time;
  }
}

// Whether no answer came, in time or for the network. Of an answer that was given up, another turn is the newest.
function isLost(error) { return error.name === "TimeoutError" || error instanceof TypeError; }
