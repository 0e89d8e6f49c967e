"""Advisories on whose word a robot's position is: claims of the receiving half in, advisory revisions out."""

from collections.abc import Iterable
from math import inf

from deconflict.advisories.finding_lifecycle import Finding, Telling, Told, about_claim
from deconflict.advisory import Location, Severity
from deconflict.foresight.presence.live_robots import LiveRobots
from ingest.batch import Claim

LOOK_S = 1.0
CLEAR_AFTER_S = 3.0


class Claims:
    """Tells of the claims that stand, a look a second. `live` is the engine's own."""

    def __init__(self, live: LiveRobots, restored: Iterable[Told] = ()) -> None:
        self._live = live
        self._telling = Telling(CLEAR_AFTER_S, restored)
        self._standing: tuple[Claim, ...] = ()
        self._looked_s = -inf

    def open(self) -> list[Told]:
        return self._telling.open()

    def adopt(self, told: Told) -> None:
        """Go on from a revision that another decided."""
        self._telling.adopt(told)

    def receive(self, standing: tuple[Claim, ...]) -> None:
        """Take in the claims that stand now."""
        self._standing = standing

    def step(self, now_s: float) -> list[Told]:
        """The revisions of this look; none between looks."""
        if now_s - self._looked_s < LOOK_S:
            return []
        self._looked_s = now_s
        owners = {uuid: one.owner for one in self._standing for uuid in one.robots}
        found = [self._finding(one) for one in self._standing]
        return self._telling.step(now_s, found, lambda uuid: self._party(uuid, owners[uuid]))

    def _finding(self, one: Claim) -> Finding:
        who = ", ".join(self._party(uuid, one.owner)[0] for uuid in one.robots[:3])
        others = f" and {one.claimed - 3} others" if one.claimed > 3 else ""
        foreign = one.owner != one.claimant
        said = (
            f"{one.claimant} reports {who}{others} of {one.owner}: refused; see GET /quarantine"
            if foreign
            else f"{who}{others} of {one.owner}: reported from two places at once; two robots may have one UUID"
        )
        return Finding(
            kind="foreign_claim" if foreign else "two_places",
            about=about_claim(one.owner, one.claimant),
            severity=Severity.WARNING,
            robots=tuple(sorted(one.robots)),
            predicted_s=one.since_s,
            location=self._place(one.robots),
            summary=lambda: said,
            evidence={"owner": one.owner, "claimant": one.claimant, "claimed": one.claimed},
        )

    def _party(self, uuid: str, owner: str) -> tuple[str, str]:
        robot = self._live.robots.get(uuid)
        return (robot.name, robot.vendor) if robot else (f"{owner} {uuid[:8]}", owner)

    def _place(self, uuids: Iterable[str]) -> Location | None:
        """Where the first of them that has a place was seen last."""
        for uuid in uuids:
            robot = self._live.robots.get(uuid)
            if robot and robot.forecast.floor[0] >= 0:
                datum = self._live.floors[int(robot.forecast.floor[0])]
                x_m, y_m = float(robot.forecast.x_m[0]), float(robot.forecast.y_m[0])
                return Location(datum=datum, x=round(x_m, 3), y=round(y_m, 3))
        return None
