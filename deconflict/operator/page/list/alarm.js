// Sound and browser notifications for what becomes critical. Both are off until somebody chooses them.

import { remember, remembered } from "./acknowledge.js";

const TONES = [[880, 0], [660, 0.18], [880, 0.36]]; // hertz, and seconds from the start
const TONE_S = 0.15;
const $ = (id) => document.getElementById(id);

export class Alarm {
  constructor() {
    for (const name of ["sound", "notify"]) {
      $(name).checked = remembered(name) === "yes";
      $(name).onchange = () => this.choose(name);
    }
    if (!("Notification" in window) || Notification.permission !== "granted") $("notify").checked = false;
  }

  async choose(name) {
    $("alarm-problem").textContent = "";
    if (name === "notify" && $("notify").checked) $("notify").checked = await this.allowed();
    if (name === "sound" && $("sound").checked) this.sound();
    remember(name, $(name).checked ? "yes" : "no");
  }

  async allowed() {
    const may = "Notification" in window && window.isSecureContext && (await Notification.requestPermission()) === "granted";
    if (!may) $("alarm-problem").textContent = "The browser allows no notifications here. They need https, or this machine, and permission.";
    return may;
  }

  // Something became critical; `text` says what.
  raise(title, text) {
    if ($("sound").checked) this.sound();
    if ($("notify").checked) new Notification(title, { body: text, tag: title });
  }

  sound() {
    this.audio ??= new AudioContext();
    const { audio } = this, begin = audio.currentTime;
    for (const [hertz, at] of TONES) {
      const tone = audio.createOscillator(), volume = audio.createGain();
      tone.frequency.value = hertz;
      volume.gain.setValueAtTime(0.2, begin + at);
      volume.gain.exponentialRampToValueAtTime(0.001, begin + at + TONE_S);
      tone.connect(volume).connect(audio.destination);
      tone.start(begin + at);
      tone.stop(begin + at + TONE_S);
    }
  }
}
