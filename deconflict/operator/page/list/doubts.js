// Which robots move otherwise than they announce, and for long enough to say so.

const SAID_AFTER_S = 10; // on end
const KEPT_S = 30; // since the service doubted it last
const ANNOUNCED = ["path", "order"]; // bases of forecasts that a robot states itself

export class Doubts {
  constructor() {
    this.robots = new Map(); // by UUID: since and until when the service doubts it, and whether that was said
    this.atS = -Infinity;
  }

  // `health` is that of the service, `robots` by UUID. Who announces nothing cannot move otherwise, and nobody on foot is doubted.
  note({ at_s: atS, distrusted = [] }, robots) {
    if (atS === undefined || atS === this.atS) return;
    for (const uuid of distrusted.filter((each) => announces(robots.get(each)))) {
      const before = this.robots.get(uuid), isOnEnd = before && (before.isSaid || before.untilS === this.atS), sinceS = isOnEnd ? before.sinceS : atS;
      this.robots.set(uuid, { sinceS, untilS: atS, isSaid: atS - sinceS >= SAID_AFTER_S });
    }
    for (const [uuid, { untilS }] of this.robots) if (atS - untilS > KEPT_S || !announces(robots.get(uuid))) this.robots.delete(uuid);
    this.atS = atS;
  }

  has(uuid) { return this.robots.get(uuid)?.isSaid ?? false; }
}

function announces(robot) { return robot && robot.participant !== "person" && ANNOUNCED.includes(robot.basis); }
