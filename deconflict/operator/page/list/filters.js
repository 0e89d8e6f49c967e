// Which situations are listed and drawn, and the search for a robot.

import { inside } from "../map/places.js";
import { SEVERITIES, SEVERITY } from "../texts.js";

const $ = (id) => document.getElementById(id);
const ANY = "";
const MOST_NAMED = 5;

export class Filters {
  // `acts`: changed(), showRobot(uuid), hideRobot().
  constructor(acts) {
    this.parts = { severity: $("by-severity"), vendor: $("by-vendor"), place: $("by-place") };
    this.offer("severity", SEVERITIES.map((severity) => [severity, SEVERITY[severity]]), "Any severity");
    for (const part of Object.values(this.parts)) part.onchange = acts.changed;
    $("all").onclick = () => { for (const part of Object.values(this.parts)) part.value = ANY; acts.changed(); };
    $("robot").onchange = () => this.find($("robot").value, acts.showRobot);
    $("filters").onsubmit = (event) => { event.preventDefault(); this.find($("robot").value, acts.showRobot); };
    $("robot").oninput = () => {
      $("not-found").textContent = "";
      if (this.found && !$("robot").value) acts.hideRobot();
    };
    Object.assign(this, { robots: [], found: null });
  }

  // What can be chosen, which changes with the site and its robots. `places` are floors and places: { id, name, polygon, floor,
  // floorName }.
  choices(vendors, places, robots) {
    this.places = new Map(places.map((place) => [place.id, place]));
    this.offer("vendor", vendors.map((vendor) => [vendor, vendor]), "Any vendor");
    const times = Map.groupBy(places, ({ name }) => name);
    this.offer("place", places.map(({ id, name, floorName }) => [id, times.get(name).length > 1 && floorName ? `${name}, ${floorName}` : name]), "Anywhere");
    this.robots = robots;
    const names = robots.map(({ name }) => name).sort().join("\n");
    if ($("names").dataset.key === names) return;
    $("names").dataset.key = names;
    $("names").replaceChildren(...names.split("\n").map((value) => Object.assign(document.createElement("option"), { value })));
  }

  offer(part, options, any) {
    const select = this.parts[part], key = JSON.stringify(options), { value } = select;
    if (select.dataset.key === key) return;
    select.dataset.key = key;
    select.replaceChildren(new Option(any, ANY), ...options.map(([id, name]) => new Option(name, id)));
    select.value = options.some(([id]) => id === value) ? value : ANY;
  }

  // Shows the robot with this name, or the only one whose name has this text. Says so if there is none, or more than one.
  find(text, showRobot) {
    const wanted = text.trim().toLowerCase(), matching = this.robots.filter(({ name }) => wanted && name.toLowerCase().includes(wanted));
    const robot = matching.find(({ name }) => name.toLowerCase() === wanted) ?? (matching.length === 1 ? matching[0] : null);
    if (robot) {
      this.found = robot;
      $("robot").value = robot.name;
      showRobot(robot.uuid);
    } else if (wanted) $("not-found").textContent = whyNotFound(text.trim(), matching);
  }

  // The name of the robot that was found stands in the search as long as it is the one that is shown.
  keep(shown) {
    if (!this.found || this.found.uuid === shown) return;
    if ($("robot").value === this.found.name) $("robot").value = "";
    this.found = null;
  }

  get active() { return Object.values(this.parts).some(({ value }) => value !== ANY); }

  matches(situation) {
    const { severity, vendor, place } = this.parts;
    return (!severity.value || SEVERITIES.indexOf(situation.severity) <= SEVERITIES.indexOf(severity.value))
      && (!vendor.value || situation.vendors.includes(vendor.value)) && (!place.value || isAt(situation, this.places.get(place.value)));
  }
}

// Why a search shows no robot: none has the text in its name, or several have.
function whyNotFound(text, matching) {
  if (!matching.length) return `No robot has “${text}” in its name.`;
  const names = matching.slice(0, MOST_NAMED).map(({ name }) => name).join(", ");
  return `${matching.length} robots have “${text}” in their names: ${names}${matching.length > MOST_NAMED ? ", …" : ""}`;
}

// At a floor, in a place, or at or near it as the headline says.
function isAt({ location, places = [] }, place) {
  if (!location || !place) return false;
  return location.datum === place.floor && (!place.polygon || inside(place.polygon, location.x, location.y) || places.some(({ id }) => id === place.id));
}
