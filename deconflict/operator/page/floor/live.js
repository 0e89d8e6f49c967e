// The live floor: frames over a WebSocket that reconnects by itself, and the service's clock.

const RETRY_MS = [300, 5000];
const QUIET_MS = 6000; // without a message for so long, the connection is taken for dead
const PAUSE_MS = 1000; // a timer that is later than this comes from a page that had no time, or slept
const DRIFT = 0.001; // seconds by which two clocks may drift apart in a second
const BEHIND_S = 4; // from this delay on the page is behind
const CATCH_UP_S = 10; // a page that is behind or hears nothing for so long begins anew, with what is there now
const LONGEST_S = 60; // the same once this has not helped several times

export function robotOf(row, floors) {
  const [uuid, vendor, name, state, floor, basis, eventS, arrivalS, doubtM, lengthM, widthM, knots, shape, trailers = []] = row;
  return { uuid, vendor, name, state, floor: floor < 0 ? null : floors[floor], basis, eventS, arrivalS, doubtM, lengthM, widthM, knots, shape, trailers: trailers.map(([length, width, ...own]) => ({ lengthM: length, widthM: width, eventS, knots: own })) };
}

export function robotsOf(frame) {
  return new Map(frame.robots.map((row) => [row[0], robotOf(row, frame.floors)]));
}

export class Live {
  // `fellBehind` is called when the page begins anew, because it could not keep up or heard nothing for long.
  constructor(fellBehind) {
    this.fellBehind = fellBehind;
    this.robots = new Map();
    this.health = {};
    this.tickS = 0;
    this.connected = false;
    this.everConnected = false;
    this.retryMs = RETRY_MS[0];
    this.heardS = Infinity;
    this.patienceS = CATCH_UP_S;
    this.begin();
    this.connect();
  }

  begin() { Object.assign(this, { offsetS: Infinity, sentS: 0, begunS: Infinity, inTimeS: Infinity }); }

  // The service's time. Messages are only ever delayed, so the least delayed one since the connection was made tells it.
  nowS() { return localS() - (Number.isFinite(this.offsetS) ? this.offsetS : 0); }

  // How late the newest message was when it came, and how long it has been the newest, seconds.
  get behindS() { return this.sentS ? this.nowS() - this.sentS : 0; }
  get isBehind() { return this.behindS > BEHIND_S; }

  connect() {
    const address = new URL("live", location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = this.socket = new WebSocket(address);
    this.watch();
    socket.onmessage = (message) => { this.watch(); this.receive(JSON.parse(message.data)); };
    socket.onclose = () => {
      clearTimeout(this.quiet);
      this.connected = false;
      this.begin();
      setTimeout(() => this.connect(), this.retryMs);
      this.retryMs = Math.min(this.retryMs * 2, RETRY_MS[1]);
    };
  }

  // Closes a connection from which nothing comes. What came while the page had no time is read first.
  watch(isAgain = false) {
    clearTimeout(this.quiet);
    const dueMs = Date.now() + QUIET_MS;
    this.quiet = setTimeout(() => (Date.now() > dueMs + PAUSE_MS && !isAgain ? this.watch(true) : this.socket.close()), QUIET_MS);
  }

  receive({ sent_s: sentS, health, floor }) {
    this.connected = this.everConnected = true;
    this.retryMs = RETRY_MS[0];
    this.note(sentS);
    if (health) this.health = health;
    if (floor.whole) this.robots = robotsOf(floor);
    else for (const row of floor.robots) this.robots.set(row[0], robotOf(row, floor.floors));
    for (const uuid of floor.gone) this.robots.delete(uuid);
    this.tickS = floor.now_s;
  }

  // Notes when a message was sent. A page that does not catch up connects again, for the newest floor in one message.
  note(sentS) {
    const nowS = localS(), silentS = nowS - this.heardS;
    if (this.offsetS === Infinity) [this.offsetS, this.begunS] = [nowS - sentS, nowS];
    else this.offsetS = Math.min(this.offsetS + DRIFT * Math.max(silentS, 0), nowS - sentS);
    [this.heardS, this.sentS] = [nowS, sentS];
    if (silentS > CATCH_UP_S) this.fellBehind();
    if (!this.isBehind) this.inTimeS = nowS;
    else if (nowS - this.inTimeS > this.patienceS) this.beginAnew();
    if (!this.isBehind && nowS - this.begunS > CATCH_UP_S) this.patienceS = CATCH_UP_S;
  }

  beginAnew() {
    this.patienceS = Math.min(2 * this.patienceS, LONGEST_S);
    this.inTimeS = Infinity;
    this.socket.close();
    this.fellBehind();
  }
}

function localS() { return Date.now() / 1000; }
