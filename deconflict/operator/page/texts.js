// Texts for people: times, names, severities, kinds of situations, advice.

export const SEVERITIES = ["critical", "warning", "caution"];
export const SIGNS = { critical: "▲", warning: "◆", caution: "●" };
export const SEVERITY = { critical: "Critical", warning: "Warning", caution: "Caution" };
// Kinds of situations, whoever is in them.
export const KINDS = {
  meeting: "Two meet", head_on: "Head-on", knot: "Knot", queue: "Queue", crowd: "Many at one point",
  blocked_aisle: "Way blocked", obstacle: "In the way", silent_robot: "Silent", deadlock: "Waiting for each other", identity: "Who is this?",
};
const ONE = new Map([["robot", "robot"], ["driven", "vehicle"], ["person", "person"]]), MANY = new Map([["robot", "robots"], ["driven", "vehicles"], ["person", "people"]]);
// By kind, its title. `kinds` is what is in it, in the order of `ONE`, `culprit` what stands in the way.
const TITLES = {
  meeting: (kinds) => (kinds.length > 1 ? `A ${ONE.get(kinds[0])} meets a ${ONE.get(kinds.at(-1))}` : `Two ${MANY.get(kinds[0])} meet`),
  head_on: (kinds) => (kinds.length > 1 ? `${kinds[0] === "driven" ? "Vehicle head-on" : "Head-on"} with a ${ONE.get(kinds.at(-1))}` : isOfRobots(kinds) ? "Head-on" : `Head-on of ${MANY.get(kinds[0])}`),
  knot: (kinds) => `Knot of ${all(kinds)}`,
  queue: (kinds) => (isOfRobots(kinds) ? "Queue" : `Queue of ${all(kinds)}`),
  crowd: (kinds) => `Many ${all(kinds)} at one point`,
  blocked_aisle: (kinds, culprit) => `Way blocked${culprit === "robot" ? "" : ` by a ${ONE.get(culprit)}`}${forPeople(kinds, culprit, " for people")}`,
  obstacle: (kinds, culprit) => `${sentence(ONE.get(culprit))} in the way${forPeople(kinds, culprit, " of people")}`,
  silent_robot: (kinds, culprit) => `Silent ${ONE.get(culprit)}${forPeople(kinds, culprit, " in the way of people")}`,
  deadlock: (kinds) => (isOfRobots(kinds) ? "Waiting for each other" : `${sentence(all(kinds))} wait for each other`),
  identity: (kinds) => `Who is this ${kinds.map((kind) => ONE.get(kind)).join(" or ")}?`,
};
// What a situation is, in the fewest words. People and vehicles with a driver are named, whatever its kind: of a ring, those that
// wait for each other, and not who meets one of them.
export function title({ situation_kind: kind, participants = [], robots = [], culprit, subject_is_ring: isRing, subject_robots: ring = [] }) {
  const named = isRing ? participants.filter((_, i) => ring.includes(robots[i])) : participants;
  const kinds = [...ONE.keys()].filter((each) => named.includes(each));
  return TITLES[kind](kinds.length ? kinds : ["robot"], participants[robots.indexOf(culprit)] ?? "robot");
}
function isOfRobots(kinds) { return kinds.join() === "robot"; }
function all(kinds) { return listed(kinds.map((kind) => MANY.get(kind))); }
function forPeople(kinds, culprit, words) { return culprit !== "person" && kinds.includes("person") ? words : ""; }
// Words as a list: "a, b and c".
export function listed(words) { return [words.slice(0, -1).join(", "), ...words.slice(-1)].filter(Boolean).join(" and "); }
export const ACTIONS = { wait: "wait", slow_down: "slow down", take_another_route: "another route", back_out: "back out", go_first: "go first", look: "look here" };
// What a robot should do, in the fewest words: "wait 12 s", "back out to Lift 1".
export function order({ action, seconds: forS, speed_mps: speed, where }) {
  const amount = action === "wait" && forS ? ` ${span(forS)}` : action === "slow_down" && speed ? ` to ${speed.toFixed(1)} m/s` : "";
  return `${ACTIONS[action]}${amount}${where && ["wait", "back_out"].includes(action) ? ` ${where}` : ""}`;
}

export const FAR_S = 90; // what begins later is marked on the map only if somebody picks it
const BEGUN_S = 4; // what began longer ago has the time since then
const CHANGED_S = 15; // advice is new for so long
const LONG_S = 120; // what is open for longer has the time of day since when it is
const MOST_NAMED = 4; // robots that the line of a situation names

export function clock(atS) {
  return new Date(atS * 1000).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", second: "2-digit", hourCycle: "h23" });
}

// A duration: seconds below 100 s, then minutes, with a decimal below 10 min, and hours from 2 h on.
export function span(s) {
  const wholeS = Math.max(Math.round(s), 0);
  if (wholeS < 100) return `${wholeS} s`;
  return wholeS < 7200 ? `${(wholeS / 60).toFixed(wholeS < 597 ? 1 : 0)} min` : `${Math.round(wholeS / 3600)} h`;
}

export function ago(s) {
  return s < 1.5 ? "just now" : `${span(s)} ago`;
}

export function countdown(situation, nowS) {
  if (isOver(situation)) return "";
  const left = seconds(situation.predicted_at) - nowS;
  return left < -BEGUN_S ? `for ${span(-left)}` : left < 0.5 ? "now" : `in ${span(Math.ceil(left))}`;
}

export function seconds(at) { return Date.parse(at) / 1000; }

// Whether every advisory of a situation has ended. It stays for some seconds, in case others follow.
export function isOver({ kind, advisories }) { return kind === "situation" && !advisories.length; }

// What happens, without time (the countdown beside it is current) and advice. Revisions of older releases have a summary only.
export function what({ headline, summary }) { return headline || summary; }

// The robots of a situation, if its sentence does not name the first of them: at most four, and how many more.
export function unnamed(situation) {
  const { names, vendors, more_robots: others } = situation, first = names.slice(0, MOST_NAMED), more = names.length - first.length + (others ?? 0);
  if (first.every((name) => what(situation).includes(name))) return "";
  return listed([...first.map((name, i) => short(name, vendors[i])), ...(more ? [`${more} more`] : [])]);
}

export function severityOf(revision) { return isOver(revision) ? "✓ Over" : `${SIGNS[revision.severity]} ${SEVERITY[revision.severity]}`; }

// Whether somebody has to do something about it now: neither robots nor other advice come first.
export function needsSomebody(situation) { return !isCalm(situation) && !isOver(situation) && !situation.people_wait_for; }

// Whether somebody has to do something critical now: neither robots nor other advice come first.
export function isDue({ severity, people_wait_for: first }) { return severity === "critical" && !first; }

// Whether nobody has to do anything: such a card is one line until it is chosen.
export function isCalm({ severity, advice }) { return severity === "caution" && !advice?.for_people; }

const WAITING = {
  robots: "Nothing to do yet: its robots are asked first. If none of them accepts within 10 s, you are asked.",
  other_advice: "Nothing to do yet: you were asked for something else less than a minute ago, or something more severe comes first.",
};

// What people do: the first thing, and the other things after it. If there is nothing, for what they wait, or how it ends, and
// what programs do.
export function toDo(situation, nowS) {
  const { advice, ends, people_wait_for: first } = situation;
  if (isOver(situation)) return { first: "", then: "Nothing to do any more." };
  if (advice?.for_people) {
    const [first, ...then] = steps(advice, nowS);
    return { first: sentence(first), then: then.length ? `Then: ${then.join("; ")}` : "" };
  }
  const programs = advice ? ` Programs that move robots are advised: ${steps(advice, nowS).join("; ")}.` : "";
  return { first: "", then: `${WAITING[first] ?? `Nothing to do now. It ends ${ends}.`}${programs}` };
}

// Who has it done, and why by these robots.
export function by({ advice, robots, vendors, participants = [] }) {
  if (!advice?.for_people) return "";
  const asked = advice.actions.filter(({ action }) => !["go_first", "look"].includes(action)), vendorOf = new Map(robots.map((uuid, i) => [uuid, vendors[i]]));
  const isPerson = ({ robot }) => participants[robots.indexOf(robot)] === "person", vendorsOf = (actions) => [...new Set(actions.map(({ robot }) => vendorOf.get(robot)))].filter(Boolean);
  const controls = vendorsOf(asked.filter((action) => !isPerson(action))), people = vendorsOf(asked.filter(isPerson));
  const who = [controls.length ? `by the fleet control of ${controls.join(" and ")}, or by hand at the robot` : "", ...people.map((vendor) => `tell ${vendor}`)];
  const why = asked.filter(({ reason }) => reason).map(({ name, robot, reason }) => `Why ${short(name, vendorOf.get(robot) ?? "")}: ${reason}.`);
  return [...who.filter(Boolean).map((text) => `${sentence(text)}.`), ...why].join(" ");
}

// What has been asked of robots of a situation by their vendors' programs, and what came of it so far.
export function asked({ robots }, advice) {
  const own = advice.filter(({ robot, other }) => robots.includes(robot) && (!other || robots.includes(other)));
  return own.map(({ headline, vendor, begun_at: begun, acknowledgement: answer }) => {
    const reply = answer ? `${vendor} has ${answer.answer === "done" ? "done it" : `${answer.answer} it`}` : `${vendor} has not answered`;
    return `Asked: ${headline}; ${begun ? "it has begun" : reply}.`;
  }).join(" ");
}

// An action as far as it is still to do: of a time that runs since it was advised, what is left.
export function leftOf(action, { since_at: since }, nowS) {
  return action.seconds && !action.start_at ? { ...action, seconds: Math.max(Math.round(action.seconds - (nowS - seconds(since))), 1) } : action;
}

// The actions as sentences, and what is left of a time. Revisions of older releases have one text only.
function steps(advice, nowS) {
  const steps = advice.actions.filter(({ text }) => text).map((action) => {
    const { seconds: leftS } = leftOf(action, advice, nowS);
    return leftS < action.seconds ? `${action.text} (${span(leftS)} left)` : action.text;
  });
  return steps.length ? steps : [advice.text];
}

// Why the advice for people has changed, as long as that is news.
export function change({ advice }, nowS) {
  const forS = advice ? nowS - seconds(advice.since_at) : Infinity;
  return advice?.for_people && advice.changed_because && forS < CHANGED_S ? `New advice, ${ago(forS)}: ${advice.changed_because}` : "";
}

export function since(situation, nowS) {
  const sinceS = seconds(situation.raised_at), forS = nowS - sinceS;
  return forS < LONG_S ? `listed for ${span(forS)}` : `listed since ${clock(sinceS).slice(0, 5)}`;
}

export function sentence(text) { return text.charAt(0).toUpperCase() + text.slice(1); }

export const NOUNS = new Map([["robot", ["robot", "robots"]], ["person", ["person", "people"]], ["driven", ["driven vehicle", "driven vehicles"]]]);

// How many robots, people and driven vehicles there are: "45 robots, 15 people, 4 driven vehicles".
export function counted(robots) {
  const groups = Map.groupBy(robots, ({ participant }) => participant), kinds = [...NOUNS].filter(([kind]) => kind === "robot" || groups.has(kind));
  return kinds.map(([kind, [one, many]]) => plural(groups.get(kind)?.length ?? 0, one, many)).join(", ");
}

export function plural(count, noun, several = `${noun}s`) { return `${count} ${count === 1 ? noun : several}`; }

// The probability that a silent robot is still there; empty if it is certain.
export function likely(robot) {
  if (!(robot.there < 0.995)) return "";
  return robot.there < 0.5 ? ", has probably left" : `, ${Math.round(100 * robot.there)} % likely still there`;
}

export function short(name, vendor) {
  return name.toLowerCase().startsWith(`${vendor.toLowerCase()} `) ? name.slice(vendor.length + 1) : name;
}

// In their order, which the service gives.
export function mostUrgentFirst(situations) {
  return situations.toSorted((a, b) => compare(a.order ?? [], b.order ?? []) || (a.id < b.id ? -1 : 1));
}

function compare(a, b) {
  const at = a.findIndex((number, i) => number !== b[i]);
  return at < 0 ? 0 : a[at] - (b[at] ?? 0);
}

// Each cell of a table says of which column it is: on a phone the cells of a row stand below each other.
export function titled(table) {
  const heads = [...table.tHead.rows[0].cells].map(({ textContent }) => textContent.trim());
  for (const row of table.tBodies[0].rows) [...row.cells].forEach((cell, at) => { if (cell.colSpan === 1) cell.dataset.head = heads[at]; });
}
