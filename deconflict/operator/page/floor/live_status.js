// What the page says about the live floor and its warnings: whether they are of now, and if not, of when.

import { ago, clock, counted, span } from "../texts.js";

const LIVE_S = 2; // "Live" needs a message that is younger: the service sends two a second
const STALE_S = 3;
const HEALTH_S = 10; // what an older message says of the engine is not known to hold

// The state's name, and a sentence.
export function liveStatus(live, feed) {
  if (!live.connected) return live.everConnected ? ["lost", `Connection to the service lost${live.tickS ? `: ${floorOf(live)}${olderList(live, feed)}` : ""}`] : ["loading", "Connecting to the service…"];
  const late = live.nowS() - live.tickS, { health } = live, down = Object.entries(health.roles ?? {}).filter(([, status]) => status !== "up").map(([role]) => role);
  if (!live.tickS) return ["loading", down.length ? `Waiting for the ${down.join(" and the ")}…` : "Loading the floor…"];
  if (live.ageS >= LIVE_S) return ["stale", `This page is ${span(live.ageS)} behind: ${floorOf(live)}${olderList(live, feed)}`];
  const { preparing } = health;
  if (late > STALE_S) return ["stale", `Nothing new since ${clock(live.tickS)}, ${ago(late)}: ${down.length ? `the ${down.join(" and the ")} is down` : preparing ? "the engine is being prepared" : "predictions have stopped"}${olderList(live, feed)}`];
  if (preparing && preparing.done < preparing.total) return ["preparing", `No warnings yet: the engine is being prepared, once on this machine (${preparing.done} of ${preparing.total})`];
  if (preparing || health.engine_starting) return ["preparing", "No warnings yet: the engine is starting"];
  if (health.roles?.engine === "down") return ["unwarned", "No warnings: the engine is down. Robots are shown as they report"];
  if (live.sentS - health.at_s > HEALTH_S) return ["unwarned", `Not known whether the engine warns: nothing is heard of it since ${clock(health.at_s)}`];
  if (!feed.loaded) return ["loading", "Loading the warnings…"];
  if (live.nowS() - feed.completeS > STALE_S) return ["unwarned", `No new warnings arrive: ${listOf(live, feed)}`];
  const reduced = { coarse: "separations are rough", near: "only near conflicts are shown" }[health.effort];
  if (reduced) return ["live", `Live, but the service can't keep up: ${reduced}`];
  if (health.delivery?.reason) return ["live", `Live, but ${health.delivery.reason}`];
  return ["live", `Live: ${counted([...live.robots.values()])}`];
}

function listOf(live, { completeS }) { return `these are the warnings of ${clock(completeS)}, ${ago(live.nowS() - completeS)}`; }

// Of when the warnings are, if they are older than the floor.
function olderList(live, feed) { return feed.completeS && feed.completeS < live.tickS - STALE_S ? `; ${listOf(live, feed)}` : ""; }

function floorOf(live) { return `this is the floor at ${clock(live.tickS)}, ${ago(live.nowS() - live.tickS)}`; }
