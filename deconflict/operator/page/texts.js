// Texts for people: times, names, severities, advice.

export const SEVERITIES = ["critical", "warning", "caution"];
export const SIGNS = { critical: "▲", warning: "◆", caution: "●" };

export function clock(atS) {
  return new Date(atS * 1000).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", second: "2-digit", hourCycle: "h23" });
}

export function ago(s) {
  if (s < 1.5) return "just now";
  return s < 120 ? `${Math.round(s)} s ago` : `${Math.round(s / 60)} min ago`;
}

export function countdown(advisory, nowS) {
  const left = Date.parse(advisory.predicted_at) / 1000 - nowS;
  return left < 0.5 ? "now" : `${Math.ceil(left)} s`;
}

// The summary, without its number of seconds, which only was right when it was written (the countdown beside it is current),
// and without the advice at its end, which has a line of its own.
export function what(advisory) {
  const note = advisory.recommendation?.note;
  const parts = advisory.summary.replace(/,? in \d+ s\b/, "").split("; ");
  return parts.filter((part, i) => i === 0 || !(part.includes(" should wait ") || note?.split("; ").includes(part))).join("; ");
}

// The probability that a silent robot is still there; empty if it is certain.
export function likely(robot) {
  if (!(robot.there < 0.995)) return "";
  return robot.there < 0.5 ? ", has probably left" : `, ${Math.round(100 * robot.there)} % likely still there`;
}

export function short(name, vendor) {
  return name.toLowerCase().startsWith(`${vendor.toLowerCase()} `) ? name.slice(vendor.length + 1) : name;
}

export function advice(advisory, nameOf) {
  const { recommendation } = advisory;
  if (!recommendation) return "";
  const holds = recommendation.holds.map((hold) => `${nameOf(hold.robot)} should wait ${+hold.hold_s.toFixed(1)} s`);
  const slots = recommendation.slots.map((slot, i) => `${i + 1}. ${nameOf(slot.robot)}${slot.wait_s >= 1 ? ` (waits ${Math.round(slot.wait_s)} s)` : ""}`);
  const order = slots.length ? [`order: ${slots.join(", ")}`] : [];
  return [...holds, ...order, ...(recommendation.note ? [recommendation.note] : [])].join("; ");
}

export function urgency(a, b) {
  const rank = SEVERITIES.indexOf(a.severity) - SEVERITIES.indexOf(b.severity);
  return rank || Date.parse(a.predicted_at) - Date.parse(b.predicted_at) || (a.id < b.id ? -1 : 1);
}
