"""Advisories on robots that two vendors report, that are reported from two places at once, or many of them from one.

Claims of the receiver and crowds in, advisory revisions out. When an advisory is raised and cleared,
`finding_lifecycle` decides.
"""

from collections.abc import Iterable, Mapping
from math import inf

from deconflict.advisories.finding_lifecycle import Finding, FindingAdvisory, FindingLifecycle, NamedRobot, about_both
from deconflict.advisories.words import finding_words
from deconflict.contention.crowds.crowds import Crowd, Crowds
from deconflict.foresight.presence.live_robots import LiveRobot, LiveRobots
from deconflict_client.advisory import ClaimAdvisory, CrowdAdvisory, Location, Severity
from ingest.batch import Claim

JudgedAdvisory = ClaimAdvisory | CrowdAdvisory
"""The advisories that `ClaimLifecycle` judges."""
LOOK_S = 1.0
CLEAR_AFTER_S = 3.0
NAMED_ROBOTS = 10
"""So many robots of a crowd are named in its advisory, and the first three in its text."""


class ClaimLifecycle:
    """Looks once a second at the claims and crowds that stand."""

    def __init__(self, live: LiveRobots, crowds: Crowds, restored: Iterable[FindingAdvisory] = ()) -> None:
        """`live` and `crowds` are the engine's, `restored` the advisories that were open before a restart."""
        self._live, self._crowds = live, crowds
        self._lifecycle = FindingLifecycle(CLEAR_AFTER_S, restored)
        self._standing: tuple[Claim, ...] = ()
        self._looked_s = -inf

    def open(self) -> list[FindingAdvisory]:
        """The newest revision of every open advisory."""
        return self._lifecycle.open()

    def adopt(self, revision: FindingAdvisory) -> None:
        """Continue from a revision that another process made."""
        self._lifecycle.adopt(revision)

    def receive(self, standing: tuple[Claim, ...]) -> None:
        """Replace the claims by those that stand now."""
        self._standing = standing

    def step(self, now_s: float) -> list[FindingAdvisory]:
        """The revisions of this look; none between looks."""
        if now_s - self._looked_s < LOOK_S:
            return []
        self._looked_s = now_s
        owners = {uuid: claim.owner for claim in self._standing for uuid in claim.robots}
        findings = [self._finding(claim) for claim in self._standing]
        findings += [_crowd_finding(crowd, self._live.robots, now_s) for crowd in self._crowds.standing()]
        return self._lifecycle.revise(now_s, findings, lambda uuid: self._named(uuid, owners.get(uuid, "")))

    def _finding(self, claim: Claim) -> Finding:
        names = [self._named(uuid, claim.owner).name for uuid in claim.robots[:3]]
        return Finding(
            kind="foreign_claim" if claim.owner != claim.claimant else "two_places",
            about=about_both(claim.owner, claim.claimant),
            severity=Severity.WARNING,
            robots=tuple(sorted(claim.robots)),
            predicted_s=claim.since_s,
            location=self._location(claim.robots),
            words=lambda: finding_words.claim(claim.owner, claim.claimant, claim.claimed, names),
            evidence={"owner": claim.owner, "claimant": claim.claimant, "claimed": claim.claimed},
        )

    def _named(self, uuid: str, owner: str) -> NamedRobot:
        if robot := self._live.robots.get(uuid):
            return NamedRobot(robot.name, robot.vendor, robot.participant)
        return NamedRobot(f"{owner} {uuid[:8]}", owner)

    def _location(self, uuids: Iterable[str]) -> Location | None:
        """Where the first of some robots is whose place is known; None if none is."""
        for uuid in uuids:
            robot = self._live.robots.get(uuid)
            if robot and robot.forecast.floor[0] >= 0:
                datum = self._live.floors[int(robot.forecast.floor[0])]
                x_m, y_m = float(robot.forecast.x_m[0]), float(robot.forecast.y_m[0])
                return Location(datum=datum, x=round(x_m, 3), y=round(y_m, 3))
        return None


def _crowd_finding(crowd: Crowd, robots: Mapping[str, LiveRobot], now_s: float) -> Finding:
    """Robots that can't all be where they report from."""
    location = Location(datum=crowd.datum, x=round(crowd.x_m, 3), y=round(crowd.y_m, 3))
    count = len(crowd.robots)
    return Finding(
        kind="crowd",
        about=about_both(crowd.label, crowd.datum),
        severity=Severity.WARNING,
        robots=crowd.robots[:NAMED_ROBOTS],
        predicted_s=now_s,
        location=location,
        words=lambda: finding_words.crowd(
            count, crowd.label, location.x, location.y, [robots[uuid].name for uuid in crowd.robots[:3]]
        ),
        evidence={"vendor": crowd.label, "crowded": count},
    )
