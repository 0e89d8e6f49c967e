// What the page says about itself: whether it shows the live floor, and if not, why not.

import { ago, clock, span } from "../texts.js";

const STALE_S = 4;

// The state's name, and a sentence.
export function statusOf(live, past) {
  if (past.atS !== null) return ["past", past.problem || `Showing ${clock(past.atS)}, ${ago(live.nowS() - past.atS)}${past.floor?.atS === past.atS ? "" : ", reading…"}`];
  if (!live.connected) return live.everConnected
    ? ["lost", `Connection to the service lost${live.tickS ? `: this is the floor at ${clock(live.tickS)}` : ""}`] : ["loading", "Connecting to the service…"];
  const late = live.nowS() - live.tickS, down = Object.entries(live.health.roles ?? {}).filter(([, status]) => status !== "up").map(([role]) => role);
  if (!live.tickS) return ["loading", down.length ? `Waiting for the ${down.join(" and the ")}…` : "Loading the floor…"];
  const { preparing } = live.health;
  if (preparing && preparing.done < preparing.total) return ["preparing", `No warnings yet: the engine is being prepared, once on this machine (${preparing.done} of ${preparing.total})`];
  if (preparing || (late <= STALE_S && live.health.engine_starting)) return ["preparing", "No warnings yet: the engine is starting"];
  if (late <= STALE_S && live.health.roles?.engine === "down") return ["unwarned", "No warnings: the engine is down. Robots are shown as they report"];
  if (live.isBehind) return ["stale", `This page is ${span(live.behindS)} behind: this is the floor at ${clock(live.tickS)}`];
  if (late > STALE_S) return ["stale", `Nothing new since ${clock(live.tickS)}: ${down.length ? `the ${down.join(" and the ")} is down` : "predictions have stopped"}`];
  const reduced = { coarse: "separations are rough", near: "only near conflicts are shown" }[live.health.effort];
  if (reduced) return ["live", `Live, but the service can't keep up: ${reduced}`];
  if (live.health.delivery?.reason) return ["live", `Live, but ${live.health.delivery.reason}`];
  return ["live", `Live: ${live.robots.size} robots`];
}
