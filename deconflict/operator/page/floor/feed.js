// The open situations and advisories, read once and then kept up to date by the stream.

const RETRY_MS = 1000;
const MOST = 10_000; // as many as the service lists
export const FADE_MS = 8000;

export class Feed {
  // `revised` is called with each revision of a situation, the one before if it was open, and whether this is how it is now: when what
  // is open was read anew.
  constructor(revised) {
    this.revised = revised;
    this.advisories = new Map();
    this.situations = new Map();
    this.ended = new Map(); // situations that were cleared in the last `FADE_MS`
    this.loaded = false;
    this.isStale = false; // whether what is open has to be read anew
    this.start();
  }

  async start() {
    const before = this.loaded ? this.situations : null;
    try {
      const [situations, advisories] = await Promise.all([read(`situations?limit=${MOST}`), read(`advisories?limit=${MOST}`)]);
      this.situations = byId(situations.situations);
      this.advisories = byId(advisories.advisories);
      this.loaded = true;
      this.isStale = false;
      this.follow(Math.min(situations.seq, advisories.seq));
    } catch {
      setTimeout(() => this.start(), RETRY_MS);
      return;
    }
    if (before) for (const situation of this.situations.values()) this.revised(situation, before.get(situation.id), true);
  }

  follow(seq) {
    const address = new URL(`advisories/stream?after=${seq}&kinds=situation,advisory`, location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = this.socket = new WebSocket(address);
    socket.onmessage = (message) => {
      if (this.isStale) return;
      const revision = JSON.parse(message.data);
      seq = revision.seq;
      this.take(revision);
    };
    socket.onclose = ({ code }) => setTimeout(() => (code === 4416 || this.isStale ? this.start() : this.follow(seq)), RETRY_MS);
  }

  // Reads what is open anew: after a while that is less than all that happened.
  renew() {
    this.isStale = true;
    this.socket?.close();
  }

  take(revision) {
    const open = revision.kind === "situation" ? this.situations : this.advisories, before = open.get(revision.id);
    if (before?.seq >= revision.seq) return; // the two lists were read one after the other
    if (revision.state === "cleared") open.delete(revision.id);
    else open.set(revision.id, revision);
    if (revision.kind !== "situation") return;
    if (before && revision.state === "cleared") this.fade(before, revision);
    this.revised(revision, before);
  }

  // A situation that ended stays for some seconds, as it was last.
  fade(before, cleared) {
    this.ended.set(before.id, { ...before, ...cleared, outline: before.outline, endedMs: Date.now() });
    setTimeout(() => this.ended.delete(before.id), FADE_MS);
  }
}

async function read(address) {
  const answer = await fetch(address);
  if (!answer.ok) throw new Error(answer.statusText);
  return answer.json();
}

function byId(revisions) {
  return new Map(revisions.map((revision) => [revision.id, revision]));
}
