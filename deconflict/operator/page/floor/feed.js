// The open situations, advisories and advice, read once and then kept up to date by the stream.

import { pageS } from "./page_clock.js";
import { Turns, read } from "./reading.js";

const RETRY_MS = 1000;
const RENEW_S = 10; // a list that is not complete is read anew, but not more often
const MOST = 10_000; // as many as the service lists
const MOST_MARKS = 100;
export const FADE_MS = 8000;

export class Feed {
  // `revised` is called with each revision of a situation, the one before if it was open, and whether this is how it is now: when what
  // is open was read anew.
  constructor(revised) {
    this.revised = revised;
    this.advisories = new Map();
    this.situations = new Map();
    this.advice = new Map();
    this.ended = new Map(); // situations that were cleared in the last `FADE_MS`
    this.loaded = false;
    this.completeS = 0; // the service's time of which this is all that was open
    this.published = []; // which number the service had published until when, from the oldest that the page may lack: { seq, atS }
    this.turns = new Turns();
    this.renew();
  }

  // Reads what is open anew: after a while that is less than all that happened. What was asked for before is not taken any more.
  async renew() {
    const turn = this.turns.next(), before = this.loaded ? this.situations : null;
    Object.assign(this, { seq: null, isWhole: true, renewedS: pageS() });
    this.socket?.close();
    try {
      const [situations, advisories, advice] = await Promise.all(["situations", "advisories", "advice"].map((what) => read(`${what}?limit=${MOST}`)));
      if (!this.turns.isNewest(turn)) return;
      this.situations = byId(situations.situations);
      this.advisories = byId(advisories.advisories);
      this.advice = byId(advice.advice);
      this.loaded = true;
      this.seq = Math.min(situations.seq, advisories.seq, advice.seq);
      this.follow(turn);
    } catch {
      this.renewLater(turn, RETRY_MS);
      return;
    }
    this.reach();
    if (before) for (const situation of this.situations.values()) this.revised(situation, before.get(situation.id), true);
  }

  renewLater(turn, afterMs) { setTimeout(() => { if (this.turns.isNewest(turn)) this.renew(); }, afterMs); }

  follow(turn) {
    const address = new URL(`advisories/stream?after=${this.seq}&kinds=situation,advisory,advice`, location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = this.socket = new WebSocket(address);
    socket.onmessage = (message) => { if (this.turns.isNewest(turn)) this.receive(JSON.parse(message.data)); };
    socket.onclose = ({ code }) => {
      if (code === 4416) this.renewLater(turn, RETRY_MS);
      else setTimeout(() => { if (this.turns.isNewest(turn)) this.follow(turn); }, RETRY_MS);
    };
  }

  // A revision that comes again or late is left out. If one is missing, the lists are not complete from then on.
  receive(revision) {
    if (revision.seq <= this.seq) return;
    if (revision.seq > this.seq + 1) this.isWhole = false;
    this.seq = revision.seq;
    this.take(revision);
    this.reach();
  }

  // The service's newest number was `seq` at its time `atS`. Lists that stay behind are read anew.
  hasPublished(seq, atS) {
    const last = this.published.at(-1), isAnew = last && seq < last.seq;
    if (isAnew) this.published = [];
    if (last?.seq === seq) last.atS = atS;
    else this.published.push({ seq, atS });
    if (this.published.length > MOST_MARKS) this.published.shift();
    this.reach();
    const isDue = this.seq !== null && pageS() - this.renewedS > RENEW_S;
    if (isAnew || (isDue && (!this.isWhole || atS - this.completeS > RENEW_S))) this.renew();
  }

  reach() {
    if (this.seq === null || !this.isWhole) return;
    while (this.published.length > 1 && this.published[0].seq <= this.seq) this.completeS = this.published.shift().atS;
    if (this.published[0]?.seq <= this.seq) this.completeS = this.published[0].atS;
  }

  take(revision) {
    const open = { situation: this.situations, advice: this.advice }[revision.kind] ?? this.advisories, before = open.get(revision.id);
    if (before?.seq >= revision.seq) return; // the lists were read one after the other
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

function byId(revisions) {
  return new Map(revisions.map((revision) => [revision.id, revision]));
}
