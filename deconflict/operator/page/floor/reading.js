// Reads answers of the service, sends it decisions, and tells which answers nobody waits for any more.

const LONGEST_MS = 20_000; // an answer that has not come by then is lost

// An answer as it is now: no cache keeps one. Throws if there is none.
export async function read(address, signal = AbortSignal.timeout(LONGEST_MS)) {
  const answer = await fetch(address, { cache: "no-store", signal });
  if (!answer.ok) throw new Error((await answer.json().catch(() => ({}))).detail ?? answer.statusText);
  return answer.json();
}

// Sends what somebody decided. Throws if the service does not say in time that it is stored.
export async function post(address, decision) {
  const answer = await fetch(address, {
    method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(decision), signal: AbortSignal.timeout(LONGEST_MS),
  }).catch((error) => { throw error.name === "TimeoutError" ? new Error("no answer yet; look whether it is there before you send it again") : error; });
  if (answer.ok) return;
  const { detail } = await answer.json();
  throw new Error(Array.isArray(detail) ? detail.map((error) => error.msg).join("; ") : String(detail));
}

// Whoever asks takes a turn. The answer counts only while that turn is the newest.
export class Turns {
  constructor() { this.next(); }
  next() { return this.newest = Symbol("turn"); }
  isNewest(turn) { return turn === this.newest; }
}
