// Which robots and places of a floor are marked, because they are part of a situation.

import { FAR_S, isOver, leftOf, seconds } from "../texts.js";

// What is over marks nothing, nor does what is far ahead, unless its id is in `picked`. `situations` are the most urgent first: its
// severity is that of a robot in two of them. `advisoriesOf(id)` are those behind a situation. `listedS` is the time of the list.
export function involvedIn(situations, picked, advisoriesOf, nowS, listedS) {
  const involved = new Map(), first = new Set(), advised = new Map(), contended = new Map();
  for (const situation of situations.filter((each) => !each.endedMs && !isOver(each)).reverse()) {
    const { id, severity, robots, advice, predicted_at: begins } = situation;
    if (seconds(begins) - nowS > FAR_S && !picked.has(id)) continue;
    for (const uuid of robots) involved.set(uuid, severity);
    const actions = advice?.for_people || picked.has(id) ? advice?.actions ?? [] : [];
    if (actions.length) first.add(actions[0].robot);
    for (const each of actions) advised.set(each.robot, leftOf(each, advice, listedS));
    for (const advisory of advisoriesOf(id)) for (const place of placesOf(advisory)) contended.set(place, { ...advisory, severity });
  }
  return { involved, first, advised, contended };
}

// The places that an advisory is about. How many wait for one of several is not known of each.
function placesOf({ resource, resources }) { return resources?.length ? resources : resource ? [resource] : []; }
