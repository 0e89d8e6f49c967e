// The open advisories: read once, then followed; and the list that shows them.

import { SIGNS, advice, countdown, urgency, what } from "./words.js";

const RETRY_MS = 1000;

export class Advisories {
  constructor(changed) {
    this.changed = changed;
    this.open = new Map();
    this.loaded = false;
    this.start();
  }

  async start() {
    try {
      const answer = await fetch("advisories?limit=1000");
      if (!answer.ok) throw new Error(answer.statusText);
      const { seq, advisories } = await answer.json();
      this.open = new Map(advisories.map((one) => [one.id, one]));
      this.loaded = true;
      this.changed();
      this.follow(seq);
    } catch {
      setTimeout(() => this.start(), RETRY_MS);
    }
  }

  follow(seq) {
    const address = new URL(`advisories/stream?after=${seq}`, location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(address);
    socket.onmessage = (message) => {
      const one = JSON.parse(message.data);
      seq = one.seq;
      if (one.state === "cleared") this.open.delete(one.id);
      else this.open.set(one.id, one);
      this.changed(one);
    };
    socket.onclose = (end) => setTimeout(() => (end.code === 4416 ? this.start() : this.follow(seq)), RETRY_MS);
  }
}

export class List {
  constructor(list, { choose, acknowledge }) {
    this.list = list;
    this.choose = choose;
    this.acknowledge = acknowledge;
    this.items = new Map();
  }

  show(advisories, { nowS, chosen, nameOf, floorName, past }) {
    const sorted = [...advisories].sort(urgency);
    const ids = new Set(sorted.map((one) => one.id));
    for (const [id, item] of this.items) if (!ids.has(id)) { item.remove(); this.items.delete(id); }
    const focused = document.activeElement;
    sorted.forEach((one, i) => {
      const item = this.items.get(one.id) ?? this.made(one.id);
      if (this.list.children[i] !== item) this.list.insertBefore(item, this.list.children[i] ?? null);
      this.fill(item, one, { nowS, nameOf, floorName, past });
      item.classList.toggle("chosen", one.id === chosen);
    });
    if (focused !== document.activeElement && this.list.contains(focused)) focused.focus();
  }

  made(id) {
    const item = document.createElement("li"), part = (tag, kind) => Object.assign(document.createElement(tag), { className: kind });
    const top = part("div", "top"), acts = part("div", "acts");
    item.dataset.id = id;
    item.parts = {
      severity: part("span", "severity"), when: part("span", "when"), what: part("p", "what"), advice: part("p", "advice"),
      answer: part("p", "answer"), show: part("button", "show"), take: part("button", "take"),
    };
    const { severity, when, show, take } = item.parts;
    show.type = take.type = "button";
    show.textContent = "Show on the map";
    take.textContent = "Acknowledge";
    show.onclick = () => this.choose(id);
    take.onclick = () => this.acknowledge(id);
    top.append(severity, when);
    acts.append(show, take);
    item.append(top, item.parts.what, item.parts.advice, item.parts.answer, acts);
    this.items.set(id, item);
    return item;
  }

  fill(item, one, { nowS, nameOf, floorName, past }) {
    const said = advice(one, nameOf), answer = one.acknowledgement, { parts } = item;
    item.classList.remove("critical", "warning", "caution");
    item.classList.add(one.severity);
    say(parts.severity, `${SIGNS[one.severity]} ${one.severity}`);
    say(parts.when, countdown(one, nowS));
    say(parts.what, what(one));
    say(parts.advice, said ? `Advised: ${said}` : one.claimant ? "" : "No advice yet");
    parts.advice.classList.toggle("none", !said);
    say(parts.answer, answer ? `✓ ${answer.name}: ${answer.reason}` : "");
    parts.answer.hidden = !answer;
    parts.show.setAttribute("aria-label", `Show on the map: ${what(one)}`);
    parts.take.setAttribute("aria-label", `Acknowledge: ${what(one)}`);
    parts.take.disabled = past;
    item.dataset.floor = one.location ? floorName(one.location.datum) : "";
    item.dataset.kind = one.kind;
    parts.show.hidden = !one.location;
  }
}

function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
