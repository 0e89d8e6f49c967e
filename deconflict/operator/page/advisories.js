// The open advisories, read once and then kept up to date by the stream, and the list that shows them.

import { SIGNS, advice, countdown, urgency, what } from "./texts.js";

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
      this.open = new Map(advisories.map((advisory) => [advisory.id, advisory]));
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
      const advisory = JSON.parse(message.data);
      seq = advisory.seq;
      if (advisory.state === "cleared") this.open.delete(advisory.id);
      else this.open.set(advisory.id, advisory);
      this.changed(advisory);
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
    const ids = new Set(sorted.map((advisory) => advisory.id));
    for (const [id, item] of this.items) if (!ids.has(id)) { item.remove(); this.items.delete(id); }
    const focused = document.activeElement;
    sorted.forEach((advisory, i) => {
      const item = this.items.get(advisory.id) ?? this.newItem(advisory.id);
      if (this.list.children[i] !== item) this.list.insertBefore(item, this.list.children[i] ?? null);
      this.fill(item, advisory, { nowS, nameOf, floorName, past });
      item.classList.toggle("chosen", advisory.id === chosen);
    });
    if (focused !== document.activeElement && this.list.contains(focused)) focused.focus();
  }

  newItem(id) {
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

  fill(item, advisory, { nowS, nameOf, floorName, past }) {
    const advised = advice(advisory, nameOf), answer = advisory.acknowledgement, { parts } = item;
    item.classList.remove("critical", "warning", "caution");
    item.classList.add(advisory.severity);
    setText(parts.severity, `${SIGNS[advisory.severity]} ${advisory.severity}`);
    setText(parts.when, countdown(advisory, nowS));
    setText(parts.what, what(advisory));
    setText(parts.advice, advised ? `Advised: ${advised}` : advisory.claimant ? "" : "No advice yet");
    parts.advice.classList.toggle("none", !advised);
    setText(parts.answer, answer ? `✓ ${answer.name}: ${answer.reason}` : "");
    parts.answer.hidden = !answer;
    parts.show.setAttribute("aria-label", `Show on the map: ${what(advisory)}`);
    parts.take.setAttribute("aria-label", `Acknowledge: ${what(advisory)}`);
    parts.take.disabled = past;
    item.dataset.floor = advisory.location ? floorName(advisory.location.datum) : "";
    item.dataset.kind = advisory.kind;
    parts.show.hidden = !advisory.location;
  }
}

// Changes an element only if its text differs, so that a focused or selected text stays.
function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
