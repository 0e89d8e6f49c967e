// The live floor: frames over a WebSocket that reconnects by itself, the service's clock, and how old the newest frame may be.

import { pageS } from "./page_clock.js";

const RETRY_MS = [300, 5000];
const QUIET_MS = 6000; // without a message for so long, the connection is taken for dead
const PAUSE_S = 1; // a timer that is later than this comes from a page that had no time, or slept
const DRIFT = 0.001; // seconds by which two clocks may drift apart in a second
const MARK_S = 0.3; // between two of the page's own messages at least
const MOST_MARKS = 100;
const BEHIND_S = 4; // from this delay on the page does not keep up
const CATCH_UP_S = 10; // a page that does not keep up or hears nothing for so long begins anew, with what is there now
const LONGEST_S = 60; // the same once this has not helped several times

export function robotOf(row, floors) {
  const [uuid, vendor, name, state, floor, basis, eventS, arrivalS, doubtM, lengthM, widthM, knots, participant, shape, trailers = []] = row;
  return { uuid, vendor, name, state, floor: floor < 0 ? null : floors[floor], basis, eventS, arrivalS, doubtM, lengthM, widthM, knots, participant, shape, trailers: trailers.map(([length, width, ...own]) => ({ lengthM: length, widthM: width, eventS, knots: own })) };
}

export function robotsOf(frame) {
  return new Map(frame.robots.map((row) => [row[0], robotOf(row, frame.floors)]));
}

export class Live {
  // `fellBehind` is called when the page begins anew, because it could not keep up or heard nothing for long. `hasPublished` is
  // called with the number of the newest revision, and the service's time when that was the newest.
  constructor(fellBehind, hasPublished) {
    Object.assign(this, { fellBehind, hasPublished });
    this.robots = new Map();
    this.health = {};
    this.tickS = 0;
    this.sentS = 0;
    this.connected = false;
    this.everConnected = false;
    this.retryMs = RETRY_MS[0];
    this.heardS = Infinity;
    this.patienceS = CATCH_UP_S;
    [this.leastS, this.mostS] = [-Infinity, Infinity]; // between which the page's clock is ahead of the service's
    this.connect();
  }

  // The service's time, or a little later: what the page shows is never older than it says.
  nowS() { return Number.isFinite(this.leastS) ? pageS() - this.leastS : Date.now() / 1000; }

  // How old the newest message is at most, seconds.
  get ageS() { return this.nowS() - this.sentS; }
  get isBehind() { return this.ageS > BEHIND_S; }

  connect() {
    const address = new URL("live", location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = this.socket = new WebSocket(address);
    Object.assign(this, { number: 0, sentAfterS: pageS(), marks: [], marked: 0, begunS: Infinity, inTimeS: Infinity });
    this.watch();
    socket.onmessage = (message) => { this.watch(); this.receive(JSON.parse(message.data)); };
    socket.onclose = () => this.connectAgain();
  }

  connectAgain() {
    clearTimeout(this.quiet);
    this.socket.onmessage = this.socket.onclose = null;
    this.socket.close();
    this.connected = false;
    setTimeout(() => this.connect(), this.retryMs);
    this.retryMs = Math.min(this.retryMs * 2, RETRY_MS[1]);
  }

  // Closes a connection from which nothing comes. What came while the page had no time is read first.
  watch(isAgain = false) {
    clearTimeout(this.quiet);
    const dueS = pageS() + QUIET_MS / 1000;
    this.quiet = setTimeout(() => (pageS() > dueS + PAUSE_S && !isAgain ? this.watch(true) : this.connectAgain()), QUIET_MS);
  }

  // A message that comes again or late is left out. If one is missing, the changes in it are, too: the page reads the floor anew.
  receive({ number, sent_s: sentS, heard, seq, health, floor }) {
    if (number <= this.number) return;
    if (number > this.number + 1) return this.connectAgain();
    this.number = number;
    this.connected = this.everConnected = true;
    if (health) this.health = health;
    if (floor.whole) this.robots = robotsOf(floor);
    else for (const row of floor.robots) this.robots.set(row[0], robotOf(row, floor.floors));
    for (const uuid of floor.gone) this.robots.delete(uuid);
    this.tickS = floor.now_s;
    this.note(sentS, heard);
    this.hasPublished(seq, sentS);
  }

  // The page numbers its own messages. What has such a number was sent after it, and what has none after the connection was asked for.
  sentAfter(heard) {
    while (this.marks.length && this.marks[0].marked <= heard) this.sentAfterS = this.marks.shift().atS;
    if (this.socket.readyState === WebSocket.OPEN && this.marks.length < MOST_MARKS && !(pageS() - this.marks.at(-1)?.atS < MARK_S)) {
      this.marks.push({ marked: this.marked += 1, atS: pageS() });
      this.socket.send(this.marked);
    }
    return this.sentAfterS;
  }

  // Notes when a message was sent. A page that does not catch up connects again, for the newest floor in one message.
  note(sentS, heard) {
    const nowS = pageS(), silentS = nowS - this.heardS, most = nowS - sentS, least = this.sentAfter(heard) - sentS, drift = DRIFT * Math.max(silentS, 0);
    [this.leastS, this.mostS] = [Math.max(this.leastS - drift, least), Math.min(this.mostS + drift, most)];
    if (this.leastS > this.mostS) [this.leastS, this.mostS] = [least, most]; // the service's clock was set
    [this.heardS, this.sentS] = [nowS, sentS];
    if (this.begunS === Infinity) [this.begunS, this.inTimeS] = [nowS, nowS];
    if (silentS > CATCH_UP_S) this.fellBehind();
    if (!this.isBehind) [this.inTimeS, this.retryMs] = [nowS, RETRY_MS[0]];
    else if (nowS - this.inTimeS > this.patienceS) this.beginAnew();
    if (!this.isBehind && nowS - this.begunS > CATCH_UP_S) this.patienceS = CATCH_UP_S;
  }

  beginAnew() {
    this.patienceS = Math.min(2 * this.patienceS, LONGEST_S);
    this.connectAgain();
    this.fellBehind();
  }
}
