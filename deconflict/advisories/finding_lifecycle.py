"""The life of advisories on all but conflicts: which findings are published, and until when.

    no advisory --(2 of 3 looks find it)--> raised
    raised, updated --(robots, time, duration or severity changed enough)--> updated
    raised, updated --(not found for a while)--> cleared

`contention` and `engine.claim_lifecycle` look about once a second and hand over what they find; all decisions on its
advisory are made here.
"""

import json
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from math import hypot
from typing import Any, NamedTuple

from deconflict.advice.document_limits import (
    MOST_NAME_BYTES,
    MOST_PLACES,
    MOST_WAITS,
    limited_advice,
    short_text,
)
from deconflict.advisories.severity import rises
from deconflict.advisories.words.conflict_wording import new_id
from deconflict.advisories.words.words import RevisionWords
from deconflict_client.advisory import (
    AdvisoryState,
    BlockageAdvisory,
    ClaimAdvisory,
    ClearedCode,
    ContentionAdvisory,
    CrowdAdvisory,
    DeadlockAdvisory,
    Kind,
    Location,
    Recommendation,
    Severity,
    Wait,
    moment,
)
from deconflict_client.participant_kinds import ParticipantKind
from deconflict_client.situations import MOST_ROBOTS

LOOKS, LOOKS_NEEDED = 3, 2
"""This many of the last looks must find something before an advisory is raised on it."""
UPDATE_GAP_S, ADVICE_GAP_S = 5.0, 2.0
"""Shortest time between two revisions, unless severity rises; and before one that advises another order."""
MOVED_S, MOVED_SHARE = 3.0, 0.2
"""A change of a time by more than both, in seconds and as a share of the time left, is worth a revision."""
CROWD_MOVED_M = 5.0
"""A crowd that has moved further is worth a revision."""
RESTORED_S = 15.0
"""A restored advisory is cleared if it is not found again within this time."""

MOST_OF = {"cycle": MOST_WAITS, "holds_up": MOST_ROBOTS - 1, "resources": MOST_PLACES}
"""Most entries of the lists in a finding's evidence."""

FindingAdvisory = ContentionAdvisory | DeadlockAdvisory | BlockageAdvisory | ClaimAdvisory | CrowdAdvisory
"""Every kind of advisory but conflicts."""


class NamedRobot(NamedTuple):
    """What a finding says of one of its robots."""

    name: str
    vendor: str
    participant: ParticipantKind = "robot"


Name = Callable[[str], NamedRobot]
"""What is said of a robot that is known, by its UUID."""

MODELS: dict[str, type[FindingAdvisory]] = {
    "contention": ContentionAdvisory,
    "double_occupancy": ContentionAdvisory,
    "deadlock": DeadlockAdvisory,
    "blockage": BlockageAdvisory,
    "foreign_claim": ClaimAdvisory,
    "two_places": ClaimAdvisory,
    "crowd": CrowdAdvisory,
}
CLEARED_CODES = {
    "contention": ClearedCode.NO_LONG_WAIT,
    "double_occupancy": ClearedCode.WITHIN_CAPACITY,
    "deadlock": ClearedCode.UNLOCKED,
    "blockage": ClearedCode.OUT_OF_THE_WAY,
    "foreign_claim": ClearedCode.NOT_CLAIMED,
    "two_places": ClearedCode.ONE_PLACE,
    "crowd": ClearedCode.DISPERSED,
}


class Finding(NamedTuple):
    """What one look found."""

    kind: Kind
    about: str
    """What stays the same while it lasts: resource, blocker, robots of a ring, owner and claimant, vendor and datum."""
    severity: Severity
    robots: tuple[str, ...]
    """In ascending order."""
    predicted_s: float
    location: Location | None
    words: Callable[[], RevisionWords]
    """Called only if a revision is made: most looks find nothing new."""
    evidence: dict[str, Any]
    """The fields of its own kind of advisory."""
    recommendation: Recommendation | None = None

    @property
    def key(self) -> str:
        return f"{self.kind} {self.about}"


@dataclass(slots=True, eq=False)
class _WatchedFinding:
    """What is remembered of something that was found lately."""

    looks: deque[bool] = field(default_factory=lambda: deque(maxlen=LOOKS))
    """Whether each of the last looks found it."""
    found_s: float = 0.0
    """When it was found last."""
    advisory: FindingAdvisory | None = None
    """The newest revision of its open advisory."""


class FindingLifecycle:
    """Every finding of the last looks, and the open advisories on them."""

    def __init__(self, clear_after_s: float, restored: Iterable[FindingAdvisory] = ()) -> None:
        """`restored` are advisories that were open before a restart."""
        self._clear_after_s = clear_after_s
        self._watched = {finding_key(advisory): _WatchedFinding(advisory=advisory) for advisory in restored}
        self._is_first_look = True
        self._off_floor: set[str] = set()
        """Robots that a person took off the floor since the last look."""

    def end_without(self, off_floor: Iterable[str]) -> None:
        """At the next look, what is not found any more without these robots ends at once."""
        self._off_floor.update(off_floor)

    def open(self) -> list[FindingAdvisory]:
        """The newest revision of every open advisory."""
        return [watched.advisory for watched in self._watched.values() if watched.advisory]

    def is_open(self, key: str) -> bool:
        """Whether there is an open advisory on the finding with this key."""
        return key in self._watched and self._watched[key].advisory is not None

    def adopt(self, revision: FindingAdvisory) -> None:
        """Continue from a revision that another process made."""
        watched = self._watched.setdefault(finding_key(revision), _WatchedFinding())
        watched.advisory = None if revision.state is AdvisoryState.CLEARED else revision
        watched.found_s = max(watched.found_s, revision.updated_at.timestamp())

    def revise(self, now_s: float, findings: Iterable[Finding], named: Name) -> list[FindingAdvisory]:
        """The revisions of one look, ordered by key."""
        if self._is_first_look:
            self._is_first_look = False
            for watched in self._watched.values():
                watched.found_s = now_s + RESTORED_S - self._clear_after_s
        found = {finding.key: finding for finding in map(_limited, findings)}
        revisions: list[FindingAdvisory] = []
        off_floor, self._off_floor = self._off_floor, set()
        for key in sorted(found.keys() | self._watched.keys()):
            watched = self._watched.setdefault(key, _WatchedFinding())
            watched.looks.append(key in found)
            revision = self._revision(watched, found.get(key), now_s, named)
            if not revision and watched.advisory and key not in found:
                revision = _cleared_without(watched.advisory, off_floor, now_s)
            if revision:
                revisions.append(revision)
                watched.advisory = None if revision.state is AdvisoryState.CLEARED else revision
            if watched.advisory is None and not any(watched.looks):
                del self._watched[key]
        return revisions

    def _revision(
        self, watched: _WatchedFinding, finding: Finding | None, now_s: float, named: Name
    ) -> FindingAdvisory | None:
        before = watched.advisory
        if finding:
            watched.found_s = max(watched.found_s, now_s)
            if before:
                return _updated(before, finding, now_s, named)
            return _raised(finding, now_s, named) if sum(watched.looks) >= LOOKS_NEEDED else None
        if before and now_s - watched.found_s >= self._clear_after_s:
            return before.cleared_revision(now_s, CLEARED_CODES[before.kind])
        return None


def _cleared_without(advisory: FindingAdvisory, off_floor: set[str], now_s: float) -> FindingAdvisory | None:
    """The revision that clears an advisory of which a robot was taken off the floor; None if none was."""
    names = [name for uuid, name in zip(advisory.robots, advisory.names, strict=True) if uuid in off_floor]
    code = ClearedCode.OFF_FLOOR
    return advisory.cleared_revision(now_s, code, code.because.format(name=" and ".join(names))) if names else None


def finding_key(advisory: FindingAdvisory) -> str:
    """The `Finding.key` of what an advisory is about."""
    if isinstance(advisory, ContentionAdvisory):
        return f"{advisory.kind} {advisory.resource}"
    if isinstance(advisory, ClaimAdvisory):
        return f"{advisory.kind} {about_both(advisory.owner, advisory.claimant)}"
    if isinstance(advisory, CrowdAdvisory):
        return f"{advisory.kind} {about_both(advisory.vendor, advisory.location.datum)}"
    about = advisory.blocker if isinstance(advisory, BlockageAdvisory) else " ".join(advisory.robots[:MOST_ROBOTS])
    return f"{advisory.kind} {about}"


def about_both(name: str, other: str) -> str:
    """The `Finding.about` of a claim, by its owner and claimant, and of a crowd, by its vendor and datum."""
    return json.dumps([name, other])


def _limited(finding: Finding) -> Finding:
    """The finding within the limits of a document. A blockage keeps its blocker."""
    kept = {name: finding.evidence[name][:most] for name, most in MOST_OF.items() if name in finding.evidence}
    robots = finding.robots[:MOST_ROBOTS]
    if finding.kind == "blockage":
        robots = tuple(sorted((finding.evidence["blocker"], *kept["holds_up"])))
    more = {"more_robots": len(finding.robots) - len(robots)}
    if "resources" in kept:
        more["more_resources"] = len(finding.evidence["resources"]) - len(kept["resources"])
    if "resource_name" in finding.evidence:
        kept["resource_name"] = short_text(finding.evidence["resource_name"], MOST_NAME_BYTES)
    return finding._replace(
        about=" ".join(robots) if finding.kind == "deadlock" else finding.about,
        robots=robots,
        evidence=finding.evidence | kept | more,
        recommendation=finding.recommendation and limited_advice(finding.recommendation, robots),
    )


def _raised(finding: Finding, now_s: float, named: Name) -> FindingAdvisory:
    return MODELS[finding.kind](
        id=new_id(finding.key, now_s),
        kind=finding.kind,
        revision=1,
        state=AdvisoryState.RAISED,
        raised_at=moment(now_s),
        **_fields(finding, now_s, named),
    )


def _updated(before: FindingAdvisory, finding: Finding, now_s: float, named: Name) -> FindingAdvisory | None:
    """The next revision; None if the finding differs too little, or it is too soon."""
    is_worse = rises(finding.severity, before.severity)
    advice = finding.recommendation
    is_other_advice = advice is not None and advice is not before.recommendation
    is_other_order = is_other_advice and _order(advice) != _order(before.recommendation)
    gap_s = ADVICE_GAP_S if is_other_order else UPDATE_GAP_S
    if not is_worse and now_s - before.updated_at.timestamp() < gap_s:
        return None
    if not is_worse and not is_other_order and not _is_news(before, finding, now_s):
        return None
    return before.next_revision(**_fields(finding, now_s, named))


def _fields(finding: Finding, now_s: float, named: Name) -> dict[str, Any]:
    parties = [named(uuid) for uuid in finding.robots]
    return {
        "severity": finding.severity,
        "robots": finding.robots,
        "names": tuple(short_text(name, MOST_NAME_BYTES) for name, *_ in parties),
        "vendors": tuple(party.vendor for party in parties),
        "participants": tuple(party.participant for party in parties),
        "updated_at": moment(now_s),
        "predicted_at": moment(finding.predicted_s),
        "time_to_conflict_s": _time_left_s(finding, now_s),
        "location": finding.location,
        "recommendation": finding.recommendation,
        **finding.words()._asdict(),
        **finding.evidence,
    }


def _is_news(before: FindingAdvisory, finding: Finding, now_s: float) -> bool:
    """Whether a person or a site service would act otherwise on the finding than on the advisory."""
    left_s = before.time_left_s(now_s)
    moved_s = abs((moment(finding.predicted_s) - before.predicted_at).total_seconds())
    has_begun = before.time_to_conflict_s == 0 and _time_left_s(finding, now_s) == 0
    if not has_begun and moved_s > max(MOVED_S, MOVED_SHARE * left_s):
        return True
    if finding.severity != before.severity:
        return True
    if isinstance(before, CrowdAdvisory):
        return _is_other_crowd(before, finding)
    return finding.robots != before.robots or _is_other_evidence(before, finding.evidence)


def _is_other_evidence(
    before: ContentionAdvisory | DeadlockAdvisory | BlockageAdvisory | ClaimAdvisory, evidence: Mapping[str, Any]
) -> bool:
    """Whether the fields of a kind of advisory differ enough."""
    if isinstance(before, ContentionAdvisory):
        longer_s = abs(evidence["wait_s"] - before.wait_s)
        has_other_wait = longer_s > max(MOVED_S, MOVED_SHARE * before.wait_s)
        return bool(has_other_wait or evidence["queue_length"] != before.queue_length)
    if isinstance(before, BlockageAdvisory):
        return bool(evidence["holds_up"] != before.holds_up)
    if isinstance(before, ClaimAdvisory):
        return bool(evidence["claimed"] >= 2 * before.claimed)
    return _who_waits(evidence["cycle"]) != _who_waits(before.cycle)


def _is_other_crowd(before: CrowdAdvisory, finding: Finding) -> bool:
    """Whether a crowd is elsewhere, or has twice or half as many robots. Which ones they are is no news."""
    here, crowded = finding.location or before.location, finding.evidence["crowded"]
    moved_m = hypot(here.x - before.location.x, here.y - before.location.y)
    return moved_m > CROWD_MOVED_M or not before.crowded < 2 * crowded < 4 * before.crowded


def _who_waits(cycle: Iterable[Wait]) -> list[tuple[str, str]]:
    return [(wait.waiter, wait.holder) for wait in cycle]


def _time_left_s(finding: Finding, now_s: float) -> float:
    return round(max(finding.predicted_s - now_s, 0.0), 3)


def _order(advice: Recommendation | None) -> list[tuple[str, str]]:
    """The robots and resources of a recommendation's slots, in order, and the robots and kinds of its actions."""
    if advice is None:
        return []
    slots = [(slot.robot, slot.resource) for slot in advice.slots]
    return slots + [(action.robot, action.action) for action in advice.actions]
