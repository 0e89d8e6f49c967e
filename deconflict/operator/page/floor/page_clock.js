// The page's own clock: it never runs back, whoever sets the machine's clock, and counts the time in which the machine slept.

const SLEPT_S = 1; // by so much the machine's clock must gain on that of the page, which may stand still in sleep

let aheadS = wallS() - runS(), sleptS = aheadS;

// Seconds; at first those since the epoch.
export function pageS() {
  const nowAheadS = wallS() - runS();
  if (nowAheadS > aheadS + SLEPT_S) sleptS += nowAheadS - aheadS;
  if (Math.abs(nowAheadS - aheadS) > SLEPT_S) aheadS = nowAheadS;
  return runS() + sleptS;
}

function runS() { return performance.now() / 1000; }
function wallS() { return Date.now() / 1000; }
