// Puts the page together: what is shown follows from the live picture, or from the past where the slider is there.

import { Advisories, List } from "./advisories.js";
import { Camera } from "./camera.js";
import { Live } from "./live.js";
import { FloorMap, swatch } from "./map.js";
import { Past } from "./past.js";
import { Vendors } from "./vendors.js";
import { ago, clock, countdown, likely, short, urgency, what } from "./words.js";

const STALE_S = 4;
const LISTED = 200;
const HEAT_MS = 60_000;
const EXITS_MS = 20_000;
const FRAME_MS = 30;
const $ = (id) => document.getElementById(id);
const root = document.documentElement;

const vendors = new Vendors();
const live = new Live(() => {});
const advisories = new Advisories(announce);
const past = new Past({ moment: $("moment"), back: $("back"), forth: $("forth"), live: $("live"), shown: $("shown") }, () => live.nowS(), () => list());
let moved = false;
const camera = new Camera($("map"), (byHand) => { moved ||= byHand === true; }, press);
const map = new FloorMap($("map"), camera, vendors);
const cards = new List($("advisories"), { choose, acknowledge });
let site = { name: "", floors: [], places: [], horizon_s: 10, quiet_after_s: 3, silent_after_s: 10, vendors: [] };
let floor = null, chosen = null, robotShown = null, heat = null, exits = [], framesDrawn = 0, drawn = 0;

// Which floors there are: the site's, then any other that robots are on.
function floors() {
  const known = site.floors.map((one) => one.id);
  const others = new Set([...robots().values()].map((one) => one.floor).filter((id) => id !== null && !known.includes(id)));
  return [...site.floors, ...[...others].sort().map((id) => ({ id, name: `Floor ${id.slice(0, 8)}`, marks: [] }))];
}

function robots() { return past.floor ? past.floor.robots : live.robots; }
function open() { return past.atS === null ? [...advisories.open.values()] : past.floor?.advisories ?? []; }
function nowS() { return past.floor ? past.floor.atS : frozenS() ?? live.nowS(); }
function frozenS() { return root.dataset.state === "lost" || root.dataset.state === "stale" ? live.tickS : null; }
function floorName(id) { return floors().find((one) => one.id === id)?.name ?? id; }

function nameOf(uuid) {
  const known = robots().get(uuid);
  if (known) return known.name;
  const told = open().find((one) => one.robots.includes(uuid));
  return told ? told.names[told.robots.indexOf(uuid)] : uuid.slice(0, 8);
}

function state() {
  if (past.atS !== null) return ["past", past.problem || `Showing ${clock(past.atS)}, ${ago(live.nowS() - past.atS)}${past.floor?.atS === past.atS ? "" : ", reading…"}`];
  if (!live.connected) return live.everConnected
    ? ["lost", `Connection to the service lost: this is the floor at ${clock(live.tickS)}`] : ["loading", "Connecting to the service…"];
  const late = live.nowS() - live.tickS, down = Object.entries(live.health.roles ?? {}).filter(([, one]) => one !== "up").map(([role]) => role);
  if (!live.tickS) return ["loading", down.length ? `Waiting for the ${down.join(" and the ")}…` : "Loading the floor…"];
  if (late > STALE_S) return ["stale", `Nothing new since ${clock(live.tickS)}: ${down.length ? `the ${down.join(" and the ")} is down` : "predictions have stopped"}`];
  const short = { coarse: "how near is told roughly", near: "only what is near is told" }[live.health.effort];
  if (short) return ["live", `Live, but the service can't keep up: ${short}`];
  return ["live", `Live: ${live.robots.size} robots`];
}

// Whether another robot has driven through its place since it was heard; such a robot is not drawn until it reports again.
function isTakenOff(robot) { return !past.floor && robot.arrivalS <= (live.health.taken_off?.[robot.uuid] ?? -1) + 0.01; }

function onFloor() { return [...robots().values()].filter((one) => one.floor === floor); }

function mark(robot, atS, unidentified) {
  const silence = atS - robot.arrivalS;
  robot.there = past.floor ? 1 : live.health.fading?.[robot.uuid] ?? 1;
  robot.away = robot.there < 1 || silence > site.silent_after_s ? "silent" : silence > site.quiet_after_s ? "quiet" : unidentified.has(robot.uuid) ? "unidentified" : "";
  robot.unidentified = unidentified.has(robot.uuid);
}

function scene() {
  const atS = nowS(), unidentified = new Set(past.floor ? [] : live.health.unidentified ?? []);
  const here = onFloor().filter((one) => !isTakenOff(one));
  for (const robot of here) mark(robot, atS, unidentified);
  const told = open().filter((one) => one.location?.datum === floor).sort(urgency), involved = new Map(), contended = new Map();
  for (const one of [...told].reverse()) {
    for (const uuid of one.robots) involved.set(uuid, one.severity);
    if (one.resource) contended.set(one.resource, one);
  }
  return {
    floor, theme: root.dataset.theme, nowS: atS, robots: here, advisories: told, involved, contended, chosen, robot: robotShown, horizonS: site.horizon_s,
    heat: heat && $("heat").ariaPressed === "true" ? heat : null,
    places: site.places.filter((one) => one.floor === floor), marks: floors().find((one) => one.id === floor)?.marks ?? [],
    exits: past.floor ? [] : exits.filter((one) => one.datum === floor),
    plan: floors().find((one) => one.id === floor)?.plan,
    poseS: () => atS,
  };
}

function bounds(shown) {
  const points = [...shown.marks.map((one) => [one.x, one.y]), ...shown.places.flatMap((one) => one.polygon), ...shown.robots.map((one) => one.knots.slice(1, 3))];
  if (!points.length) return [-10, -10, 10, 10];
  const xs = points.map((one) => one[0]).sort((a, b) => a - b), ys = points.map((one) => one[1]).sort((a, b) => a - b);
  return [xs[0] - 1, ys[0] - 3, xs.at(-1) + 1, ys.at(-1) + 2];
}

function draw(at) {
  requestAnimationFrame(draw);
  if (at - drawn < FRAME_MS) return;
  drawn = at;
  const [now, words] = state();
  if (root.dataset.state !== now) root.dataset.state = now;
  if ($("status").textContent !== words) $("status").textContent = words;
  floor ??= floors()[0]?.id ?? null;
  const shown = scene();
  if (!moved && shown.robots.length + shown.marks.length) camera.fit(bounds(shown));
  map.draw(shown);
  framesDrawn += 1;
  root.dataset.frames = framesDrawn;
}

function tabs() {
  const told = floors(), counts = new Map();
  for (const one of open()) counts.set(one.location?.datum, (counts.get(one.location?.datum) ?? 0) + 1);
  const key = JSON.stringify([told.map((one) => [one.id, one.name, counts.get(one.id)]), floor]);
  if ($("tabs").dataset.key === key) return;
  $("tabs").dataset.key = key;
  const focused = $("tabs").contains(document.activeElement);
  $("tabs").replaceChildren(...told.map((one) => {
    const tab = document.createElement("button"), count = counts.get(one.id);
    tab.type = "button";
    tab.setAttribute("role", "tab");
    tab.setAttribute("aria-controls", "stage");
    tab.setAttribute("aria-selected", String(one.id === floor));
    tab.tabIndex = one.id === floor ? 0 : -1;
    tab.append(one.name);
    if (count) tab.append(Object.assign(document.createElement("span"), { className: "open", textContent: count, ariaLabel: `${count} open advisories` }));
    tab.onclick = () => show(one.id);
    return tab;
  }));
  if (focused) $("tabs").querySelector('[aria-selected="true"]')?.focus();
}

function show(id) {
  if (floor !== id) moved = false;
  floor = id;
  list();
}

function list() {
  const told = open(), past_ = past.atS !== null;
  tabs();
  cards.show(told, { nowS: nowS(), chosen, nameOf, floorName, past: past_ });
  $("count").textContent = told.length ? `(${told.length})` : "";
  $("none").hidden = told.length > 0;
  $("none").textContent = past_ ? "Nothing was predicted at that moment." : advisories.loaded ? "Nothing is predicted." : "Loading…";
  const known = [...robots().values()], here = onFloor();
  for (const one of known) vendors.know(one.vendor);
  vendors.legend($("legend"), root.dataset.theme, swatch);
  $("nothing").hidden = here.length > 0;
  $("nothing").textContent = !live.everConnected ? "Connecting to the service…" : known.length ? "No robot is on this floor." : "No robot has been heard yet. Point the robots at the service; they appear by themselves.";
  $("map").setAttribute("aria-label", `Map of ${floorName(floor)}: ${here.length} robots, ${told.filter((one) => one.location?.datum === floor).length} open advisories. Arrow keys move, plus and minus zoom, 0 shows all.`);
  $("clock").textContent = clock(nowS());
  vendors.table($("vendors").tBodies[0], live.health);
  if ($("robots").open) table(here);
  detail();
}

function table(here) {
  const rows = here.sort((a, b) => (a.name < b.name ? -1 : 1)).slice(0, LISTED).map((one) => {
    const row = document.createElement("tr"), head = document.createElement("th");
    head.scope = "row";
    head.textContent = `${one.unidentified ? "? " : ""}${one.name}`;
    row.append(head, ...[presence(one), `${one.knots[1].toFixed(1)}, ${one.knots[2].toFixed(1)}`, ago(nowS() - one.arrivalS)].map((said) => {
      const cell = document.createElement("td");
      cell.textContent = said;
      return cell;
    }));
    return row;
  });
  $("robots").querySelector("tbody").replaceChildren(...rows);
}

function presence(robot) {
  if (isTakenOff(robot)) return "not there: another has driven through its place";
  return robot.away === "silent" ? `silent${likely(robot)}` : robot.state;
}

function detail() {
  const robot = robotShown && robots().get(robotShown);
  $("detail").hidden = !robot;
  if (!robot) return;
  const title = document.createElement("strong"), facts = document.createElement("dl");
  title.textContent = robot.name;
  const told = [["state", isTakenOff(robot) || robot.away === "silent" ? presence(robot) : robot.state], ["heard", ago(nowS() - robot.arrivalS)], ["forecast", `from its ${robot.basis}`], ["size", `${robot.lengthM} × ${robot.widthM} m`]];
  if (robot.unidentified) told.push(["identity", "not told yet: size and name are assumed"]);
  for (const [term, fact] of told) {
    facts.append(Object.assign(document.createElement("dt"), { textContent: term }), Object.assign(document.createElement("dd"), { textContent: fact }));
  }
  $("detail").replaceChildren(title, facts);
}

function announce(one) {
  if (one && one.state === "raised" && one.severity !== "caution" && !one.acknowledgement && past.atS === null) $("say").textContent = `${what(one)}, in ${countdown(one, nowS())}`;
  list();
}

function choose(id) {
  chosen = id;
  const one = open().find((other) => other.id === id);
  if (!one) return;
  if (one.location) {
    floor = one.location.datum;
    moved = true;
    camera.scale = Math.max(camera.scale, 28);
    camera.look(one.location.x, one.location.y);
  }
  $("map").scrollIntoView({ block: "nearest" });
  list();
}

function press(px, py) {
  const [x, y] = camera.metres(px, py), shown = scene();
  const pointed = shown.advisories.find((one) => Math.hypot(camera.px(one.location.x) - px, camera.py(one.location.y) - py) < 14);
  if (pointed) {
    chosen = pointed.id;
    list();
    document.querySelector("#advisories .chosen").scrollIntoView({ block: "nearest" });
    return;
  }
  const near = shown.robots.map((one) => [Math.hypot(one.x - x, one.y - y), one.uuid]).sort((a, b) => a[0] - b[0])[0];
  robotShown = near && near[0] < Math.max(1.5, 16 / camera.scale) ? near[1] : null;
  list();
}

function acknowledge(id) {
  const one = open().find((other) => other.id === id), dialog = $("acknowledge");
  $("acknowledge-what").textContent = one.summary;
  $("refused").textContent = "";
  $("why").value = "";
  $("who").required = !site.sign_in;
  $("who").closest("label").hidden = site.sign_in;
  $("who").value ||= remembered("name") ?? "";
  dialog.returnValue = "";
  dialog.querySelector("form").onsubmit = (event) => {
    if (event.submitter?.value !== "send") return;
    event.preventDefault();
    send(id, $("who").value, $("why").value);
  };
  dialog.showModal();
}

async function send(id, name, reason) {
  try {
    const answer = await fetch(`advisories/${encodeURIComponent(id)}/acknowledgement`, {
      method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify({ name, reason }),
    });
    if (!answer.ok) throw new Error(told((await answer.json()).detail));
    remember("name", name);
    $("acknowledge").close();
  } catch (error) {
    $("refused").textContent = `Not stored: ${error.message}`;
  }
}

function told(detail) { return Array.isArray(detail) ? detail.map((one) => one.msg).join("; ") : String(detail); }

function remembered(key) { try { return localStorage.getItem(key); } catch { return null; } }
function remember(key, value) { try { localStorage.setItem(key, value); } catch { /* a private window keeps nothing */ } }

function dress(theme) {
  root.dataset.theme = theme;
  $("theme").textContent = theme === "dark" ? "Light" : "Dark";
}

$("theme").onclick = () => { const next = root.dataset.theme === "dark" ? "light" : "dark"; dress(next); remember("theme", next); list(); };
$("fit").onclick = () => { moved = false; };
$("closer").onclick = () => camera.zoom(1.3);
$("wider").onclick = () => camera.zoom(1 / 1.3);
$("map").addEventListener("keydown", (event) => { if (event.key === "0") moved = false; });
$("tabs").addEventListener("keydown", (event) => {
  const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key], ids = floors().map((one) => one.id);
  if (step) show(ids[(ids.indexOf(floor) + step + ids.length) % ids.length]);
});
$("heat").onclick = () => {
  $("heat").setAttribute("aria-pressed", String($("heat").ariaPressed !== "true"));
  warm();
};

async function warm() {
  if ($("heat").ariaPressed !== "true") return;
  const until = past.atS === null ? "" : `?until_s=${past.atS}`;
  try { heat = await (await fetch(`heat${until}`)).json(); } catch { /* the live stream says that the service is lost */ }
}

async function leavings() {
  try { ({ exits } = await (await fetch("presence")).json()); } catch { /* the live stream says that the service is lost */ }
}

async function begin() {
  try {
    site = await (await fetch("site")).json();
  } catch {
    setTimeout(begin, 1000);
    return;
  }
  $("site").textContent = document.title = site.name;
  vendors.order(site.vendors.map((one) => one.name));
  vendors.people = new Set(site.vendors.filter((one) => one.participant === "person").map((one) => one.name));
  list();
}

const darkness = matchMedia("(prefers-color-scheme: dark)");
const settled = () => remembered("theme") ?? (darkness.matches ? "dark" : "light");
darkness.onchange = () => { dress(settled()); list(); };
dress(settled());
begin();
setInterval(list, 250);
setInterval(warm, HEAT_MS);
leavings();
setInterval(leavings, EXITS_MS);
requestAnimationFrame(draw);
