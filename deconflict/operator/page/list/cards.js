// The list of situations: a card each, the most urgent first, with the advisories behind it.

import { SEVERITIES, SIGNS, asked, by, change, countdown, isCalm, isOver, mostUrgentFirst, plural, sentence, severityOf, short, since, title, toDo, unnamed, what } from "../texts.js";

const MOST_CARDS = 5; // the others are shown on request
const STILL_MS = 30_000; // a pointer that has not moved for so long has been left on the cards

export class Cards {
  // `acts` are called with what a person does: choose(id), acknowledge(id), point(id, robot), showRobot(uuid).
  constructor(list, more, acts) {
    Object.assign(this, { list, more, acts, cards: new Map(), all: false, movedMs: -Infinity, shown: new Set() });
    list.onpointermove = list.onpointerdown = () => { this.movedMs = Date.now(); };
    list.onpointerleave = () => { this.movedMs = -Infinity; };
    more.onclick = () => { this.all = !this.all; acts.changed(); };
  }

  // `ended` are those that were cleared lately; `behind(id)` are the advisories of a situation.
  show(open, ended, view) {
    const [urgent, over] = [open, ended].map((situations) => mostUrgentFirst(situations)), sorted = this.inOrder([...urgent, ...over]), ids = new Set(sorted.map(({ id }) => id));
    const shown = this.shown = new Set([...this.isHeld() ? this.shown : [], ...urgent.slice(0, MOST_CARDS).map(({ id }) => id), view.chosen, ...over.filter(({ id }) => this.shown.has(id)).map(({ id }) => id)]);
    for (const [id, card] of this.cards) if (!ids.has(id)) this.remove(id, card);
    sorted.forEach((situation, i) => {
      const card = this.cards.get(situation.id) ?? this.newCard(situation.id);
      if (this.list.children[i] !== card) this.move(card, this.list.children[i] ?? null);
      card.hidden = !this.all && !shown.has(situation.id);
      if (!card.hidden) this.fill(card, situation, view);
    });
    this.more.hidden = open.length <= MOST_CARDS;
    setText(this.more, this.all ? "Show fewer" : `Show ${open.length - MOST_CARDS} more, less urgent`);
  }

  // Whether somebody points at the cards: then none changes its place, so that nobody presses a wrong one.
  isHeld() { return Date.now() - this.movedMs < STILL_MS; }

  // The most urgent first, as they come; or, while they are held, as they are.
  inOrder(sorted) {
    if (!this.isHeld()) return sorted;
    const order = [...this.cards.keys()].sort((a, b) => this.cards.get(a).compareDocumentPosition(this.cards.get(b)) & Node.DOCUMENT_POSITION_FOLLOWING ? -1 : 1);
    const at = ({ id }) => (order.includes(id) ? order.indexOf(id) : order.length);
    return sorted.toSorted((a, b) => at(a) - at(b));
  }

  // A card that moves would lose the focus.
  move(card, before) {
    const held = card.contains(document.activeElement) ? document.activeElement : null;
    this.list.insertBefore(card, before);
    held?.focus();
  }

  // A person who was on a card that goes is on the list afterwards, not at the top of the page.
  remove(id, card) {
    const held = card.contains(document.activeElement);
    card.remove();
    this.cards.delete(id);
    if (held) this.list.focus();
  }

  newCard(id) {
    const card = part("li", "card"), top = part("div", "top"), buttons = part("div", "acts"), behind = part("details", "behind"), { acts } = this;
    const parts = card.parts = Object.fromEntries([["span", "severity"], ["h3", "kind"], ["span", "when"], ["p", "what"], ["p", "named"], ["p", "advice"], ["strong", "first"], ["span", "then"],
      ["p", "by"], ["p", "asked"], ["p", "changed"], ["ul", "robots"], ["p", "since"], ["p", "answer"], ["button", "show"], ["button", "take"], ["summary", "count"], ["ul", "lines"]].map(([tag, kind]) => [kind, part(tag, kind)]));
    card.dataset.id = id;
    parts.behind = behind;
    parts.show.type = parts.take.type = "button";
    parts.take.textContent = "Acknowledge";
    parts.take.title = "Or key A. Who it is and what is done can be said afterwards";
    parts.show.onclick = () => acts.choose(id);
    parts.take.onclick = () => acts.acknowledge(id);
    card.onclick = ({ target }) => { if (!card.classList.contains("ended") && !target.closest("button, details") && getSelection().isCollapsed) acts.choose(id); };
    card.onkeydown = ({ key, target }) => { if (key === "Enter" && target === card) acts.choose(id); };
    card.onpointerenter = () => acts.point(id, null);
    card.onpointerleave = () => acts.point(null, null);
    behind.ontoggle = () => acts.changed();
    top.append(parts.severity, parts.kind, parts.when);
    parts.advice.append(parts.first, parts.then);
    buttons.append(parts.since, parts.show, parts.take);
    behind.append(parts.count, parts.lines);
    card.append(top, parts.what, parts.named, parts.advice, parts.by, parts.asked, parts.changed, parts.robots, parts.answer, buttons, behind);
    this.cards.set(id, card);
    return card;
  }

  fill(card, situation, { nowS, chosen, visited, floorName, floorShown, past, behind, advice, colour }) {
    const { parts } = card, answer = situation.acknowledgement, { first, then } = toDo(situation, nowS), ended = Boolean(situation.endedMs), advisories = behind(situation.id);
    const floor = situation.location ? floorName(situation.location.datum) : "", text = what(situation);
    card.classList.remove("critical", "warning", "caution");
    card.classList.add(situation.severity);
    card.classList.toggle("chosen", situation.id === chosen);
    card.classList.toggle("ended", ended);
    card.classList.toggle("over", isOver(situation));
    card.classList.toggle("answered", Boolean(answer));
    card.classList.toggle("advised", Boolean(first));
    card.classList.toggle("calm", isCalm(situation));
    card.tabIndex = isCalm(situation) && !ended ? 0 : -1;
    setText(parts.severity, ended ? "✓ Over" : severityOf(situation));
    setText(parts.kind, title(situation));
    setText(parts.when, ended ? "" : countdown(situation, nowS));
    setText(parts.what, ended && isCalm(situation) ? `${text}: ${(situation.cleared_because ?? "")}` : text);
    showText(parts.named, isCalm(situation) && !ended && situation.id !== chosen ? unnamed(situation) : "");
    setText(parts.first, ended ? "" : first);
    setText(parts.then, ended ? sentence((situation.cleared_because ?? "")) : then);
    showText(parts.by, ended ? "" : by(situation));
    showText(parts.asked, ended ? "" : asked(situation, advice));
    showText(parts.changed, ended ? "" : change(situation, nowS));
    this.chips(parts.robots, situation, colour);
    setText(parts.since, [situation.location && situation.location.datum !== floorShown ? floor : "", since(situation, nowS)].filter(Boolean).join(" · "));
    showText(parts.answer, answer ? `✓ ${answer.name}: ${answer.reason}` : "");
    setText(parts.take, answer ? "Add a note" : "Acknowledge");
    setText(parts.show, situation.id === visited ? "Back" : "Show on the map");
    parts.show.setAttribute("aria-label", situation.id === visited ? "Back to what the map showed before" : `Show on the map: ${what(situation)}`);
    parts.take.setAttribute("aria-label", `Acknowledge: ${what(situation)}`);
    parts.take.disabled = past || ended;
    parts.show.hidden = !situation.location;
    parts.behind.hidden = !advisories.length;
    setText(parts.count, `${plural(advisories.length, "warning")} behind it`);
    if (parts.behind.open) lines(parts.lines, advisories);
    card.dataset.floor = floor;
    card.dataset.kind = situation.situation_kind;
  }

  // A button for each robot. Those that the advice names come first.
  chips(box, situation, colour) {
    const advised = (situation.advice?.actions ?? []).map(({ robot }) => robot), key = JSON.stringify([situation.robots, situation.names, situation.vendors.map(colour), situation.more_robots, advised]);
    if (box.dataset.key === key) return;
    box.dataset.key = key;
    const robots = situation.robots.map((uuid, i) => ({ uuid, name: situation.names[i], vendor: situation.vendors[i] }));
    robots.sort((a, b) => rank(advised, a) - rank(advised, b));
    box.ariaLabel = "Robots";
    const focused = box.contains(document.activeElement) ? document.activeElement.dataset.robot : null;
    box.replaceChildren(...robots.map((robot) => this.chip(situation.id, robot, advised.includes(robot.uuid), colour(robot.vendor))));
    if (situation.more_robots) box.append(Object.assign(part("li", "more"), { textContent: `and ${situation.more_robots} more` }));
    if (focused) box.querySelector(`[data-robot="${CSS.escape(focused)}"]`)?.focus();
  }

  chip(id, { uuid, name, vendor }, isAdvised, colour) {
    const item = part("li", ""), button = part("button", isAdvised ? "chip advised" : "chip");
    button.type = "button";
    button.dataset.robot = uuid;
    button.title = name;
    button.textContent = short(name, vendor);
    button.style.setProperty("--vendor", colour);
    button.setAttribute("aria-label", `Show ${name} on the map`);
    button.onclick = () => this.acts.showRobot(id, uuid);
    button.onpointerenter = button.onfocus = () => this.acts.point(id, uuid);
    button.onpointerleave = button.onblur = () => this.acts.point(id, null);
    item.append(button);
    return item;
  }
}

// Advisories as lines of a list, the most severe first.
export function lines(list, advisories) {
  const texts = advisories.toSorted((a, b) => SEVERITIES.indexOf(a.severity) - SEVERITIES.indexOf(b.severity)).map((advisory) => `${SIGNS[advisory.severity]} ${what(advisory)}`), key = texts.join("\n");
  if (list.dataset.key === key) return;
  list.dataset.key = key;
  list.replaceChildren(...texts.map((textContent) => Object.assign(part("li", ""), { textContent })));
}

function rank(advised, { uuid }) {
  const at = advised.indexOf(uuid);
  return at < 0 ? advised.length : at;
}

function part(tag, className) {
  return Object.assign(document.createElement(tag), { className });
}

function showText(element, text) {
  setText(element, text);
  element.hidden = !text;
}

// Changes an element only if its text differs, so that a focused or selected text stays.
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
