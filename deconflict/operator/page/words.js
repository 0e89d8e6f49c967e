// What is said to people: times, names, severities, advice.

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

// The summary without its own count of seconds, which was true when it was written: the countdown beside it runs on. Nor the
// advice that ends it, which has a line of its own.
export function what(advisory) {
  const note = advisory.recommendation?.note;
  const parts = advisory.summary.replace(/,? in \d+ s\b/, "").split("; ");
  return parts.filter((part, i) => i === 0 || !(part.includes(" should wait ") || note?.split("; ").includes(part))).join("; ");
}

// How likely a silent robot is still there, where that is not sure.
export function likely(robot) {
  if (!(robot.there < 0.995)) return "";
  return robot.there < 0.5 ? ", has probably left" : `, ${Math.round(100 * robot.there)} % likely still there`;
}

export function short(name, vendor) {
  return name.toLowerCase().startsWith(`${vendor.toLowerCase()} `) ? name.slice(vendor.length + 1) : name;
}

export function advice(advisory, nameOf) {
  const told = advisory.recommendation;
  if (!told) return "";
  const holds = told.holds.map((one) => `${nameOf(one.robot)} should wait ${+one.hold_s.toFixed(1)} s`);
  const slots = told.slots.map((one, i) => `${i + 1}. ${nameOf(one.robot)}${one.wait_s >= 1 ? ` (waits ${Math.round(one.wait_s)} s)` : ""}`);
  const order = slots.length ? [`order: ${slots.join(", ")}`] : [];
  return [...holds, ...order, ...(told.note ? [told.note] : [])].join("; ");
}

export function urgency(a, b) {
  const rank = SEVERITIES.indexOf(a.severity) - SEVERITIES.indexOf(b.severity);
  return rank || Date.parse(a.predicted_at) - Date.parse(b.predicted_at) || (a.id < b.id ? -1 : 1);
}
