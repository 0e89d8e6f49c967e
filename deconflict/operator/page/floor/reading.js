// Reads answers of the service, and tells which of them nobody waits for any more.

const LONGEST_MS = 30_000; // an answer that has not come by then is lost

// An answer as it is now: no cache keeps one. Throws if there is none.
export async function read(address, signal = null) {
  const lost = AbortSignal.timeout(LONGEST_MS), answer = await fetch(address, { cache: "no-store", signal: signal ? AbortSignal.any([lost, signal]) : lost });
  if (!answer.ok) throw new Error((await answer.json().catch(() => ({}))).detail ?? answer.statusText);
  return answer.json();
}

// Whoever asks takes a turn. The answer counts only while that turn is the newest.
export class Turns {
  constructor() { this.next(); }
  next() { return this.newest = Symbol("turn"); }
  isNewest(turn) { return turn === this.newest; }
}
