// Acknowledges situations: at once, and in a dialog for who it is and what is done about it.

import { Turns, post } from "../floor/reading.js";
import { what } from "../texts.js";

const SEEN = "Seen"; // what is done about it, if nobody says more
const LATE_MS = 60_000;
export const SOMEBODY = "Somebody at the operator's page"; // who it is, until the page knows a name
export const lateFailures = new Set(); // sentences, for `LATE_MS`, of what failed when no dialog was open that could say so
const [about, why] = ["acknowledge-what", "why"].map((id) => document.getElementById(id));

// A dialog that asks who decides, and sends the decision. Each opening is a turn: no late answer changes a later one.
export class Question {
  constructor(dialog, who, refused, failed) { Object.assign(this, { dialog, who, refused, failed, turns: new Turns() }); }

  // `subject` is what is decided about, `send(name)` sends the decision.
  ask(subject, signedIn, send) {
    const turn = this.turns.next();
    this.refused.textContent = "";
    this.who.required = !signedIn;
    this.who.closest("label").hidden = signedIn;
    this.who.value ||= remembered("name") ?? "";
    this.dialog.querySelector("form").onsubmit = (event) => {
      if (event.submitter?.value !== "send") return;
      event.preventDefault();
      this.send(turn, subject, send);
    };
    this.dialog.showModal();
  }

  async send(turn, subject, send) {
    const name = this.who.value;
    try {
      await send(name);
      remember("name", name);
      if (this.turns.isNewest(turn)) this.dialog.close();
    } catch ({ message }) {
      if (this.turns.isNewest(turn) && this.dialog.open) this.refused.textContent = `${this.failed}: ${message}`;
      else this.failLate(subject, message);
    }
  }

  failLate(subject, message) {
    const sentence = `${this.failed} (${subject}): ${message}.`;
    lateFailures.add(sentence);
    setTimeout(() => lateFailures.delete(sentence), LATE_MS);
  }
}

const question = new Question(...["acknowledge", "who", "refused"].map((id) => document.getElementById(id)), "Not stored");

export function acknowledge(situation, signedIn) {
  return situation.acknowledgement ? ask(situation, signedIn) : acknowledgeAtOnce(situation, signedIn);
}

function ask(situation, signedIn) {
  about.textContent = what(situation);
  why.value = "";
  question.ask(what(situation), signedIn, (name) => store(situation, name, why.value));
}

// Orders stand for seconds, so nobody has to fill in anything first.
async function acknowledgeAtOnce(situation, signedIn) {
  try {
    await store(situation, remembered("name") ?? SOMEBODY, SEEN);
  } catch ({ message }) {
    if (document.querySelector("dialog[open]")) return question.failLate(what(situation), message);
    ask(situation, signedIn);
    question.refused.textContent = `${question.failed}: ${message}`;
  }
}

function store({ id }, name, reason) { return post(`situations/${encodeURIComponent(id)}/acknowledgement`, { name, reason }); }

export function remembered(key) { try { return localStorage.getItem(key); } catch { return null; } }
export function remember(key, value) { try { localStorage.setItem(key, value); } catch { /* a private window stores nothing */ } }
