// Puts the page together: the floor and the warnings of the time that is shown.

import { acknowledge, lateFailures, remember, remembered } from "./list/acknowledge.js";
import { Alarm } from "./list/alarm.js";
import { Camera } from "./map/camera.js";
import { Cards, lines, setText } from "./list/cards.js";
import { Costs } from "./dialogs/costs.js";
import { Feed } from "./floor/feed.js";
import { Filters } from "./list/filters.js";
import { Live } from "./floor/live.js";
import { FloorMap, swatch } from "./map/floor_map.js";
import { hatchSign } from "./map/ground_layer.js";
import { Past } from "./floor/past.js";
import { inside } from "./map/places.js";
import { poseAt } from "./map/motion.js";
import { involvedIn } from "./map/involved.js";
import { read } from "./floor/reading.js";
import { Shown } from "./floor/shown.js";
import { Shift } from "./dialogs/shift.js";
import { askOffFloor, listOffFloor } from "./list/off_floor.js";
import { RobotBox, fillTable } from "./list/robots.js";
import { Vendors } from "./list/vendors.js";
import { clock, counted, isDue, isOver, mostUrgentFirst, needsSomebody, plural, seconds, severityOf, short, title, toDo, what } from "./texts.js";

const HEAT_MS = 60_000;
const EXITS_MS = 20_000;
const RECENT_S = 150;
const FRAME_MS = 30;
const UNDRAWN_MS = 1000;
const LIST_MS = 250;
const LEAST_SHOWN_M = 5;
const EXTENT_STEP_M = 2;
const NEWS_S = 5; // an older revision is not announced: the stream sends it again after a gap
const $ = (id) => document.getElementById(id);
const root = document.documentElement;

const vendors = new Vendors();
const feed = new Feed(announce);
const live = new Live(() => feed.renew(), (seq, atS) => feed.hasPublished(seq, atS));
const shown = new Shown(live, feed);
const past = new Past({ moment: $("moment"), back: $("back"), forth: $("forth"), now: $("live"), time: $("shown") }, shown, () => { list(); readHeat(); });
let viewBefore = null; // what the map showed before it went to `of`, a situation or robot that somebody chose
let followed = null; // the robot that the map stays with
let moved = false; // whether somebody chose what the map shows; else it shows the whole floor
const views = new Map(); // by floor, what it showed when somebody left it
const extents = new Map(); // by floor, what its whole is
const alarm = new Alarm();
const filters = new Filters({ changed: () => list(), showRobot: (uuid) => showRobot(null, uuid), hideRobot });
const camera = new Camera($("map"), byHand, press);
const box = new RobotBox($("detail"), { hide: hideRobot, follow: () => { followed = followed ? null : robotShown; list(); }, takeOff: () => { const robot = live.robots.get(robotShown); if (robot) askOffFloor(robot, site.sign_in); } });
const map = new FloorMap($("map"), camera, vendors);
const cards = new Cards($("situations"), $("more"), { choose, acknowledge: (id) => acknowledgeOpen(shown.situations.find((each) => each.id === id)), point, showRobot, changed: () => list() });
let site = { name: "", floors: [], places: [], areas: [], obstacles: [], horizon_s: 10, quiet_after_s: 3, silent_after_s: 10, vendors: [] };
let floor = null, chosen = null, robotShown = null, heat = null, exits = { exits: [], atS: 0 }, framesDrawn = 0, drawn = 0;
let listedAt = -Infinity; // when the list was made, as frames are counted
let listedS = 0; // the time of what the list shows: the map shows the same waits and countdowns
let pointed = { situation: null, robot: null }; // what the pointer or the focus is on in the list

// The site's floors, then any others with robots.
function floors() {
  const known = site.floors.map((siteFloor) => siteFloor.id);
  const others = new Set([...shown.robots.values()].map((robot) => robot.floor).filter((id) => id !== null && !known.includes(id)));
  return [...site.floors, ...[...others].sort().map((id) => ({ id, name: nameOf(id), marks: [] }))];
}

function byHand(done) {
  if (done) [moved, viewBefore] = [true, null];
  if (done === "moved") followed = null;
}

// Keeps the robot that is followed in the middle of the map, also on another floor.
function follow() {
  const robot = shown.robots.get(followed);
  if (!robot?.floor) return;
  [floor, moved] = [robot.floor, true];
  camera.centreOn(...poseAt(robot, shown.atS, []));
}

function open() { return shown.situations.filter((situation) => filters.matches(situation)); }
function ended() { return shown.ended.filter((situation) => filters.matches(situation)); }
function centre({ id, name, polygon }) { return { name: name || id, x: mean(polygon, 0), y: mean(polygon, 1), polygon }; }
function mean(points, axis) { return points.reduce((total, each) => total + each[axis], 0) / points.length; }
function floorName(id) { return site.floors.find((known) => known.id === id)?.name ?? nameOf(id); }
function nameOf(id) { return id ? `Floor ${id.slice(0, 8)}` : "no floor"; } // of a floor that the site does not name

// The open advisories by the id of their situation; null for those that are part of none.
function advisoriesBySituation() {
  const { situations, advisories } = shown, ids = new Set(situations.map(({ id }) => id)), partOf = new Map(situations.flatMap((situation) => situation.advisories.map((id) => [id, situation.id])));
  return Map.groupBy(advisories, ({ id, situation_id: named }) => partOf.get(id) ?? (ids.has(named) ? named : null));
}

// Whether another robot has driven through its place since its last report. Such a robot is not drawn until it reports again.
function isTakenOff(robot) { return robot.arrivalS <= (shown.health.taken_off?.[robot.uuid] ?? -1) + 0.01; }

function onFloor() { return [...shown.robots.values()].filter((robot) => robot.floor === floor); }

// Sets how a robot is drawn: `there` is the probability that it is still there, `away` why it is drawn differently.
function setPresence(robot, atS, unidentified) {
  const silence = atS - robot.arrivalS;
  robot.there = shown.health.fading?.[robot.uuid] ?? 1;
  robot.away = robot.there < 1 || silence > site.silent_after_s ? "silent" : silence > site.quiet_after_s ? "quiet" : unidentified.has(robot.uuid) ? "unidentified" : "";
  robot.unidentified = unidentified.has(robot.uuid);
}

function scene() {
  const { atS } = shown, unidentified = new Set(shown.health.unidentified ?? []);
  const here = onFloor().filter((robot) => !isTakenOff(robot));
  for (const robot of here) setPresence(robot, atS, unidentified);
  const situations = [...mostUrgentFirst(open()), ...ended()].filter((situation) => situation.location?.datum === floor);
  const picked = new Set([chosen, pointed.situation]), highlighted = new Set(situations.filter(({ id }) => picked.has(id)).flatMap((situation) => situation.robots));
  const grouped = advisoriesBySituation();
  const known = floors().find((each) => each.id === floor);
  return {
    floor, theme: root.dataset.theme, nowS: atS, listedS, robots: here, situations, ...involvedIn(situations, picked, (id) => grouped.get(id) ?? [], atS, listedS), highlighted, picked, robot: pointed.robot ?? robotShown, horizonS: site.horizon_s,
    heat: heat && $("heat").ariaPressed === "true" && shown.isOf(heat.turn) && (shown.isPast || isRecent(heat.until_s)) ? heat : null,
    places: site.places.filter((place) => place.floor === floor), areas: site.areas.filter((area) => area.floor === floor), obstacles: site.obstacles.filter((obstacle) => obstacle.floor === floor), marks: known?.marks ?? [],
    exits: !shown.isPast && isRecent(exits.atS) ? exits.exits.filter((exit) => exit.datum === floor) : [],
    plan: known?.plan,
    poseS: () => atS,
  };
}

// Whether what is read every minute at least is of the time that is shown, or has been lost since.
function isRecent(atS) { return shown.atS - atS < RECENT_S; }

// What the map shows of a floor: all that it has had since somebody asked for the whole, or what it has now if no map shows that at once.
function bounds(scene) {
  const fixed = [...scene.marks.map((mark) => [mark.x, mark.y]), ...[...scene.places, ...scene.areas, ...scene.obstacles].flatMap((each) => each.polygon)], at = (robot) => robot.knots.slice(1, 3);
  const points = together([...fixed, ...scene.robots.map(at)], () => fixed[0] ?? at(scene.robots.reduce((a, b) => (b.uuid < a.uuid ? b : a))));
  if (!points.length) return [-10, -10, 10, 10];
  const xs = points.map((point) => point[0]), ys = points.map((point) => point[1]);
  const now = [down(Math.min(...xs)), down(Math.min(...ys)), -down(-Math.max(...xs)), -down(-Math.max(...ys))], before = extents.get(scene.floor) ?? now;
  const whole = now.map((value, side) => (side < 2 ? Math.min : Math.max)(value, before[side]));
  extents.set(scene.floor, camera.mostM.every((most, axis) => whole[axis + 2] - whole[axis] <= most) ? whole : now);
  return extents.get(scene.floor);
}

// All points, or, if no map shows them at once, those around the middle, or around `first()` if none is there: a robot that says it is far
// away, as in millimetres, puts nobody out of sight.
function together(points, first) {
  const axes = [0, 1].map((axis) => points.map((point) => point[axis])), most = camera.mostM;
  if (axes.every((values, axis) => Math.max(...values) - Math.min(...values) <= most[axis])) return points;
  const middle = axes.map((values) => values.sort((a, b) => a - b)[values.length >> 1]);
  const around = (place) => points.filter((point) => place.every((value, axis) => Math.abs(point[axis] - value) <= most[axis] / 2));
  const seen = around(middle);
  return seen.length ? seen : around(first());
}

// To whole steps, so that the map stands still while robots drive.
function down(metres) { return Math.floor((metres - 1) / EXTENT_STEP_M) * EXTENT_STEP_M; }

function animate(at) {
  requestAnimationFrame(animate);
  draw(at);
}

// Draws all that changes with time, also where the browser gives no frames, as to a window that is covered.
function draw(at) {
  if (at - drawn < FRAME_MS) return;
  drawn = at;
  if (shown.status[0] !== root.dataset.state || at - listedAt > LIST_MS) list(); // the page never says "Live" over a list made before
  say();
  attempt("map", () => {
    floor ??= floors()[0]?.id ?? null;
    follow();
    const picture = scene();
    if (!moved && picture.robots.length + picture.marks.length) camera.fit(bounds(picture));
    map.draw(picture);
    framesDrawn += 1;
    root.dataset.frames = framesDrawn;
  });
  if (shown.faults.size) say();
}

// Does what shows a part of the page. A part that can't be shown stands still, and the page is not live while one does.
function attempt(part, show) {
  try {
    show();
    shown.faults.delete(part);
  } catch (error) {
    if (shown.faults.get(part) !== `${error}`) reportError(error);
    shown.faults.set(part, `${error}`);
  }
}

function say() {
  const [name, text] = shown.status;
  if (root.dataset.state !== name) root.dataset.state = name;
  setText($("status"), text);
  setText($("notice"), [...lateFailures, live.health.notice ?? ""].join(" "));
  setText($("clock"), clock(shown.atS));
  past.say();
}

function tabs() {
  const known = floors(), counts = new Map();
  const worst = new Map();
  for (const { location, severity } of mostUrgentFirst(open().filter(needsSomebody)).reverse()) {
    counts.set(location?.datum, (counts.get(location?.datum) ?? 0) + 1);
    worst.set(location?.datum, severity);
  }
  const key = JSON.stringify([known.map(({ id, name }) => [id, name, counts.get(id), worst.get(id)]), floor]);
  if ($("tabs").dataset.key === key) return;
  $("tabs").dataset.key = key;
  const focused = $("tabs").contains(document.activeElement);
  $("tabs").replaceChildren(...known.map(({ id, name }) => {
    const tab = document.createElement("button"), count = counts.get(id);
    tab.type = "button";
    tab.setAttribute("role", "tab");
    tab.setAttribute("aria-controls", "stage");
    tab.setAttribute("aria-selected", String(id === floor));
    tab.tabIndex = id === floor ? 0 : -1;
    tab.append(name);
    if (count) tab.append(needed(count, worst.get(id)));
    tab.title = `${count ? plural(count, "situation") : "No situation"} of this floor ${count > 1 ? "need" : "needs"} somebody; the list has those of all floors, and those that end without anybody`;
    tab.onclick = () => show(id);
    return tab;
  }));
  if (focused) $("tabs").querySelector('[aria-selected="true"]')?.focus();
}

// How many situations of a floor need somebody, as part of its tab. On a phone the words are for screen readers only.
function needed(count, severity) {
  const box = Object.assign(document.createElement("span"), { className: `open ${severity}`, textContent: count });
  box.append(Object.assign(document.createElement("span"), { className: "words", textContent: count === 1 ? " needs you" : " need you" }));
  return box;
}

function show(id) {
  viewBefore = followed = null;
  if (floor !== id) {
    views.set(floor, moved && [camera.x, camera.y, camera.scale]);
    const view = views.get(id);
    moved = Boolean(view);
    if (view) [camera.x, camera.y, camera.scale] = view;
  }
  floor = id;
  list();
}

// What the list says if nobody has to do anything.
function nothing(calm) {
  if (shown.isPast) return "Nothing needed anybody at that moment.";
  const [state] = shown.status, unknown = { lost: "no connection", stale: "this page is behind", unwarned: "no warnings arrive" }[state];
  if (!feed.loaded) return "Loading…";
  if (unknown) return `Not known: ${unknown}. This was listed last:`;
  if (state === "preparing") return "No warnings yet.";
  return calm ? `Nothing needs you. ${plural(calm, "situation")} ${calm === 1 ? "ends" : "end"} without you:` : "Nothing needs you.";
}

function list() {
  if (viewBefore && !isThere(viewBefore.of)) lookBack();
  else attempt("list", makeList);
}

function makeList() {
  $("map").dataset.visited = viewBefore?.of ?? "";
  [listedAt, listedS] = [performance.now(), shown.atS];
  const listed = open(), lasting = listed.filter((situation) => !isOver(situation)), grouped = advisoriesBySituation(), others = grouped.get(null) ?? [];
  tabs();
  cards.show(listed, ended(), {
    nowS: listedS, chosen, visited: viewBefore?.of, floorName, floorShown: floor, past: shown.isPast, behind: (id) => grouped.get(id) ?? [], advice: shown.advice,
    colour: (vendor) => vendors.colour(vendor, root.dataset.theme),
  });
  const over = listed.length - lasting.length + ended().length;
  setText($("count"), lasting.length || over ? `(${[lasting.length, ...(over ? [`${over} over`] : [])].join(", ")})` : "");
  $("none").hidden = lasting.some(needsSomebody);
  const left = shown.situations.length - listed.length;
  $("filtered").hidden = !filters.active;
  setText($("filtered").firstElementChild, left ? `${plural(left, "situation")} hidden by the filter.` : "The filter hides nothing.");
  setText($("none"), nothing(lasting.length));
  $("machines").hidden = !others.length;
  setText($("machines-count"), `${plural(others.length, "warning")} for machines, no person needed`);
  if ($("machines").open) lines($("machines-lines"), others);
  listOffFloor(shown.health.off_floor ?? [], shown.atS);
  const known = [...shown.robots.values()], here = onFloor();
  vendors.note(known);
  filters.choices(vendors.names, [...floors().map(({ id, name }) => ({ id, name, floor: id })), ...site.places.map((place) => ({ ...place, name: place.name || place.id, floorName: floorName(place.floor) }))], known);
  vendors.legend($("legend"), root.dataset.theme, swatch, counted(here));
  const keepClear = $("keep-clear");
  keepClear.hidden = !site.areas.some((area) => area.floor === floor && area.keep_clear);
  hatchSign(keepClear.firstElementChild, getComputedStyle(keepClear).color);
  $("nothing").hidden = here.length > 0;
  $("nothing").textContent = !live.everConnected ? "Connecting to the service…" : !live.tickS ? "Loading the floor…" : known.length ? "No robot is on this floor." : "No robot has been heard yet. Connect the robots to the service; they appear by themselves.";
  $("map").setAttribute("aria-label", `Map of ${floorName(floor)}: ${counted(here)}, ${lasting.filter(({ location }) => location?.datum === floor).length} situations. Arrow keys move, plus and minus zoom, 0 shows all.`);
  setText($("vendors-title"), shown.isPast ? "Vendors now" : "Vendors");
  vendors.tables($("vendors").tBodies[0], $("figures").querySelector("tbody"), live.health, distrusted);
  vendors.mending($("to-mend"), live.health);
  if ($("robots").open) fillTable($("robots").querySelector("tbody"), here, shown.atS, isTakenOff, shown.isPast ? new Map() : vendors.notCompared());
  showBox();
}

function isDistrusted({ uuid }) { return live.health.distrusted?.includes(uuid) ?? false; }

// The names of a vendor's robots that drive otherwise than they announce.
function distrusted(vendor) {
  return [...live.robots.values()].filter((robot) => robot.vendor === vendor && isDistrusted(robot)).map(({ name }) => short(name, vendor)).sort();
}

// A point in words: the place that it lies in, or else its coordinates, and the floor if that is another one than the map's.
function placeName({ floor: datum, x, y }) {
  const place = site.places.find(({ floor: of, polygon }) => of === datum && inside(polygon, x, y));
  return `${place ? place.name || place.id : `${x.toFixed(1)}, ${y.toFixed(1)}`}${datum === floor || !datum ? "" : `, ${floorName(datum)}`}`;
}

function showBox() {
  filters.keep(robotShown);
  const robot = robotShown && shown.robots.get(robotShown);
  box.show(robot || null, robot && { nowS: shown.atS, isTakenOff: isTakenOff(robot), isPast: shown.isPast, isFollowed: followed === robot.uuid, whereIs: placeName, isDistrusted: !shown.isPast && isDistrusted(robot), standards: vendors.standards(robot.vendor), notCompared: shown.isPast ? null : vendors.notCompared().get(robot.uuid)?.reason });
}

// New situations are announced politely, critical ones at once unless robots or other advice come first, also if somebody acknowledged them before they became critical.
// The list has them when it is made the next time. With `isNow` a revision is no repetition, however old it is. `before` is the revision before, if it was open.
function announce(situation, before, isNow = false) {
  if (situation.state === "cleared") chosen = chosen === situation.id ? null : chosen;
  else if (!shown.isPast && (isNow || live.nowS() - seconds(situation.updated_at) < NEWS_S) && !(situation.acknowledgement && situation.severity !== "critical")) {
    const { first, then } = toDo(situation, live.nowS());
    const text = `${severityOf(situation)}: ${title(situation)}. ${what(situation)}. ${first || then}`;
    if (isDue(situation) && !(before && isDue(before))) {
      $("say").textContent = text;
      alarm.raise(title(situation), `${what(situation)}. ${first || then}`);
    }
    else if (!before) $("say-politely").textContent = text;
  }
}

function choose(id) {
  const situation = shown.situations.find((each) => each.id === id);
  if (chosen === id && viewBefore) return lookBack();
  chosen = situation ? id : null;
  if (!situation) return;
  if (situation.location) visit(id, situation.location.datum, [...situation.outline, ...situation.robots.map(placeOf).filter(Boolean)]);
  $("map").scrollIntoView({ block: "nearest" });
  list();
}

function placeOf(uuid) { return shown.robots.get(uuid)?.knots.slice(1, 3); }

// Shows some points of a floor, and at least `LEAST_SHOWN_M` around them.
function lookAt(datum, points) {
  followed = null;
  const [xs, ys] = [0, 1].map((axis) => points.map((place) => place[axis]));
  floor = datum;
  moved = true;
  camera.fit([Math.min(...xs) - LEAST_SHOWN_M, Math.min(...ys) - LEAST_SHOWN_M, Math.max(...xs) + LEAST_SHOWN_M, Math.max(...ys) + LEAST_SHOWN_M]);
}

// Goes to some points for a situation or robot that somebody chose, until he has enough of it or it is over.
function visit(of, datum, points) {
  viewBefore = { ...viewBefore ?? { floor, moved, view: [camera.x, camera.y, camera.scale] }, of };
  lookAt(datum, points);
}

function lookBack() {
  chosen = followed = null;
  if (viewBefore) {
    ({ floor, moved, view: [camera.x, camera.y, camera.scale] } = viewBefore);
    viewBefore = null;
  }
  list();
}

function isThere(id) { return feed.situations.has(id) || feed.ended.has(id) || shown.robots.has(id) || shown.situations.some((each) => each.id === id); }

function point(situation, robot) {
  pointed = { situation, robot };
}

function showRobot(id, uuid) {
  const robot = shown.robots.get(uuid);
  chosen = id;
  robotShown = uuid;
  if (robot?.floor) visit(uuid, robot.floor, [placeOf(uuid)]);
  followed = uuid;
  list();
  $("stage").scrollIntoView({ block: "nearest" }); // on a phone the box is below the map
}

function hideRobot() {
  robotShown = null;
  lookBack();
}

function press(px, py) {
  const [x, y] = camera.metres(px, py), picture = scene();
  const near = picture.robots.map((robot) => [Math.hypot(robot.x - x, robot.y - y), robot.uuid]).sort((a, b) => a[0] - b[0])[0];
  robotShown = near && near[0] < Math.max(1.5, 16 / camera.scale) ? near[1] : null;
  chosen = map.situations.at(px, py, picture) ?? null;
  list();
  document.querySelector("#situations .chosen")?.scrollIntoView({ block: "nearest" });
}

function acknowledgeOpen(situation) { if (situation && !shown.isPast) acknowledge(situation, site.sign_in); }

function fit() {
  moved = false;
  viewBefore = followed = null;
  extents.delete(floor);
}

// Acknowledges with one key: the situation with the focus, else the chosen one, else the most urgent that nobody has taken.
function acknowledgeByKey() {
  const focused = document.activeElement?.closest(".card")?.dataset.id, listed = mostUrgentFirst(open());
  const situation = listed.find(({ id }) => id === focused) ?? listed.find(({ id }) => id === chosen) ?? listed.find(({ acknowledgement }) => !acknowledgement);
  acknowledgeOpen(situation);
}

function setTheme(theme) {
  root.dataset.theme = theme;
  $("theme").textContent = theme === "dark" ? "Light" : "Dark";
}

$("theme").onclick = () => { const next = root.dataset.theme === "dark" ? "light" : "dark"; setTheme(next); remember("theme", next); list(); };
$("fit").onclick = fit;
$("closer").onclick = () => camera.zoom(1.3);
$("wider").onclick = () => camera.zoom(1 / 1.3);
$("map").addEventListener("keydown", (event) => { if (event.key === "0") fit(); });
document.addEventListener("keydown", (event) => {
  const typing = event.target.closest?.("input, select, textarea, dialog") || event.ctrlKey || event.metaKey || event.altKey;
  if (event.key === "a" && !typing) acknowledgeByKey();
  if (event.key === "/" && !typing) { event.preventDefault(); $("robot").focus(); }
});
$("tabs").addEventListener("keydown", (event) => {
  const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key], ids = floors().map(({ id }) => id);
  if (step) show(ids[(ids.indexOf(floor) + step + ids.length) % ids.length]);
});
$("heat").onclick = () => {
  $("heat").setAttribute("aria-pressed", String($("heat").ariaPressed !== "true"));
  readHeat();
};

async function readHeat() {
  const { turn } = shown;
  if ($("heat").ariaPressed !== "true" || !shown.isOf(turn)) return;
  try {
    const answer = await read(shown.isPast ? `heat?until_s=${shown.atS}` : "heat");
    if (shown.isOf(turn)) heat = { turn, ...answer };
  } catch { /* the live stream says that the service is lost */ }
}

async function readExits() {
  const { atS } = shown;
  try { exits = { atS, ...await read("presence") }; } catch { /* the live stream says that the service is lost */ }
}

async function begin() {
  try {
    site = await read("site");
  } catch {
    setTimeout(begin, 1000);
    return;
  }
  $("site").textContent = document.title = site.name;
  vendors.order(site.vendors.map((vendor) => vendor.name));
  vendors.usual = new Map(site.vendors.map(({ name, participant }) => [name, participant]));
  list();
  openMoment();
}

// A link to a moment, as in the report of a replay: #at=2026-11-23T23:10:04Z&floor=ID
async function openMoment() {
  const link = new URLSearchParams(location.hash.slice(1)), atS = Date.parse(link.get("at")) / 1000;
  if (link.has("floor")) show(link.get("floor"));
  if (!Number.isFinite(atS)) return;
  const { turn } = shown;
  await past.readSpan();
  if (turn === shown.turn) past.go(atS);
}

window.onhashchange = openMoment;
const darkness = matchMedia("(prefers-color-scheme: dark)");
const preferredTheme = () => remembered("theme") ?? (darkness.matches ? "dark" : "light");
darkness.onchange = () => { setTheme(preferredTheme()); list(); };
setTheme(preferredTheme());
new Costs(floorName, (datum, x, y) => { lookAt(datum, [[x, y]]); list(); }, () => live.nowS());
new Shift(floorName, (datum) => [...(floors().find(({ id }) => id === datum)?.marks ?? []), ...site.places.filter((place) => place.floor === datum).map(centre)], (datum) => site.areas.filter((area) => area.floor === datum), () => counted([...live.robots.values()]), () => live.nowS());
begin();
setInterval(readHeat, HEAT_MS);
readExits();
setInterval(readExits, EXITS_MS);
requestAnimationFrame(animate);
setInterval(() => { if (performance.now() - drawn > UNDRAWN_MS) draw(performance.now()); }, UNDRAWN_MS);
