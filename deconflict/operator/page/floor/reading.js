// Reads answers of the service, and tells which of them nobody waits for any more.

const LONGEST_MS = 20_000; // an answer that has not come by then is lost

// An answer as it is now: no cache keeps one. Throws if there is none.
export async function read(address, signal = AbortSignal.timeout(LONGEST_MS)) {
  const answer = await fetch(address, { cache: "no-store", signal });
  if (!answer.ok) throw new Error((await answer.json().catch(() => ({}))).detail ?? answer.statusText);
  return answer.json();
}

// Whoever asks takes a turn. The answer counts only while that turn is the newest.
export class Turns {
  constructor() { this.next(); }
  next() { return this.newest = Symbol("turn"); }
  isNewest(turn) { return turn === this.newest; }
}
