// Acknowledges situations: at once, and in a dialog for who it is and what is done about it.

import { what } from "../texts.js";

const SEEN = "Seen"; // what is done about it, if nobody says more
export const SOMEBODY = "Somebody at the operator's page"; // who it is, until the page knows a name
const dialog = document.getElementById("acknowledge");
const [about, refused, who, why] = ["acknowledge-what", "refused", "who", "why"].map((id) => document.getElementById(id));

export function acknowledge(situation, signedIn) {
  return situation.acknowledgement ? ask(situation, signedIn) : acknowledgeAtOnce(situation, signedIn);
}

function ask(situation, signedIn) {
  const { id } = situation;
  about.textContent = what(situation);
  refused.textContent = why.value = "";
  who.required = !signedIn;
  who.closest("label").hidden = signedIn;
  who.value ||= remembered("name") ?? "";
  dialog.returnValue = "";
  dialog.querySelector("form").onsubmit = (event) => {
    if (event.submitter?.value !== "send") return;
    event.preventDefault();
    send(id, who.value, why.value);
  };
  dialog.showModal();
}

// Orders stand for seconds, so nobody has to fill in anything first.
async function acknowledgeAtOnce(situation, signedIn) {
  try {
    await post(situation.id, remembered("name") ?? SOMEBODY, SEEN);
  } catch (error) {
    ask(situation, signedIn);
    refused.textContent = `Not stored: ${error.message}`;
  }
}

async function post(id, name, reason) {
  const answer = await fetch(`situations/${encodeURIComponent(id)}/acknowledgement`, {
    method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify({ name, reason }),
  });
  if (!answer.ok) throw new Error(problem((await answer.json()).detail));
}

async function send(id, name, reason) {
  try {
    await post(id, name, reason);
    remember("name", name);
    dialog.close();
  } catch (error) {
    refused.textContent = `Not stored: ${error.message}`;
  }
}

export function problem(detail) { return Array.isArray(detail) ? detail.map((error) => error.msg).join("; ") : String(detail); }

export function remembered(key) { try { return localStorage.getItem(key); } catch { return null; } }
export function remember(key, value) { try { localStorage.setItem(key, value); } catch { /* a private window stores nothing */ } }
