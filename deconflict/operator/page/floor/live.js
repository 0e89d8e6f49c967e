// The live floor: frames over a WebSocket that reconnects by itself, and the service's clock.

const RETRY_MS = [300, 5000];
const QUIET_MS = 6000;

export function robotOf(row, floors) {
  const [uuid, vendor, name, state, floor, basis, eventS, arrivalS, doubtM, lengthM, widthM, knots, shape, trailers = []] = row;
  return { uuid, vendor, name, state, floor: floor < 0 ? null : floors[floor], basis, eventS, arrivalS, doubtM, lengthM, widthM, knots, shape, trailers: trailers.map(([length, width, ...own]) => ({ lengthM: length, widthM: width, eventS, knots: own })) };
}

export function robotsOf(frame) {
  return new Map(frame.robots.map((row) => [row[0], robotOf(row, frame.floors)]));
}

export class Live {
  constructor(changed) {
    this.changed = changed;
    this.robots = new Map();
    this.health = {};
    this.tickS = 0;
    this.connected = false;
    this.everConnected = false;
    this.behindS = [];
    this.retryMs = RETRY_MS[0];
    this.frames = 0;
    this.connect();
  }

  // The service's time. Frames are only ever delayed, so the least delayed of the last frames gives the best estimate.
  nowS() {
    return Date.now() / 1000 - (this.behindS.length ? Math.min(...this.behindS) : 0);
  }

  connect() {
    const address = new URL("live", location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(address);
    const watch = () => { clearTimeout(this.quiet); this.quiet = setTimeout(() => socket.close(), QUIET_MS); };
    watch();
    socket.onmessage = (message) => { watch(); this.receive(JSON.parse(message.data)); };
    socket.onclose = () => {
      clearTimeout(this.quiet);
      this.connected = false;
      this.behindS = [];
      this.changed();
      setTimeout(() => this.connect(), this.retryMs);
      this.retryMs = Math.min(this.retryMs * 2, RETRY_MS[1]);
    };
  }

  receive(message) {
    this.connected = this.everConnected = true;
    this.retryMs = RETRY_MS[0];
    this.behindS.push(Date.now() / 1000 - message.sent_s);
    if (this.behindS.length > 50) this.behindS.shift();
    this.health = message.health;
    this.frames += 1;
    const frame = message.floor;
    if (frame.whole) this.robots = robotsOf(frame);
    else for (const row of frame.robots) this.robots.set(row[0], robotOf(row, frame.floors));
    for (const uuid of frame.gone) this.robots.delete(uuid);
    this.tickS = frame.now_s;
    this.changed();
  }
}
