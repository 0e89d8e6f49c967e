"""The life of advisories on contention, deadlocks, blockages and claims: which findings are told, and until when.

nothing --(2 of 3 looks find it)--> raised
raised, updated --(who, when, how long or how badly changed enough)--> updated
raised, updated --(not found for a while)--> cleared
"""

import json
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple
from uuid import uuid5

from deconflict.advisories.conflict_wording import ADVISORIES, SEVERITIES
from deconflict.advisory import (
    AdvisoryState,
    BlockageAdvisory,
    ClaimAdvisory,
    ContentionAdvisory,
    DeadlockAdvisory,
    Kind,
    Location,
    Recommendation,
    Severity,
    moment,
)

LOOKS, WANTED = 3, 2
UPDATE_GAP_S, ADVICE_GAP_S = 5.0, 2.0
"""At most one revision in this time, unless the severity rises; and one that advises another order."""
MOVED_S, MOVED_SHARE = 3.0, 0.2
"""Changes of a time, or of this share of what was left, that are worth a revision."""
RESTORED_S = 15.0
"""A restored advisory that is not found again within this time is cleared."""

Told = ContentionAdvisory | DeadlockAdvisory | BlockageAdvisory | ClaimAdvisory

MODELS: dict[str, type[Told]] = {
    "contention": ContentionAdvisory,
    "double_occupancy": ContentionAdvisory,
    "deadlock": DeadlockAdvisory,
    "blockage": BlockageAdvisory,
    "foreign_claim": ClaimAdvisory,
    "two_places": ClaimAdvisory,
}
OVER = {
    "contention": "nobody is expected to wait long any more",
    "double_occupancy": "no more robots are there than it takes",
    "deadlock": "they no longer wait for each other",
    "blockage": "it no longer stands in anybody's way",
    "foreign_claim": "the other vendor no longer reports them",
    "two_places": "they are reported from one place again",
}


class Finding(NamedTuple):
    """What one look found."""

    kind: Kind
    about: str
    """What stays the same while it lasts: the resource, the blocker, the ring's robots, who claims whose."""
    severity: Severity
    robots: tuple[str, ...]
    """In ascending order."""
    predicted_s: float
    location: Location | None
    summary: Callable[[], str]
    """Worded where it is told: most looks find what was told before."""
    evidence: dict[str, Any]
    """The fields of its kind of advisory."""
    recommendation: Recommendation | None = None

    @property
    def key(self) -> str:
        return f"{self.kind} {self.about}"


@dataclass(slots=True, eq=False)
class _Track:
    looks: deque[bool] = field(default_factory=lambda: deque(maxlen=LOOKS))
    found_s: float = 0.0
    advisory: Told | None = None


class Telling:
    """Every finding under watch, and the advisories open on them."""

    def __init__(self, clear_after_s: float, restored: Iterable[Told] = ()) -> None:
        self._clear_after_s = clear_after_s
        self._tracks: dict[str, _Track] = {}
        self._restored = True
        for one in restored:
            self._tracks[finding_key(one)] = _Track(advisory=one)

    def open(self) -> list[Told]:
        return [track.advisory for track in self._tracks.values() if track.advisory]

    def adopt(self, told: Told) -> None:
        """Go on from a revision that another decided."""
        track = self._tracks.setdefault(finding_key(told), _Track())
        track.advisory = None if told.state is AdvisoryState.CLEARED else told
        track.found_s = max(track.found_s, told.updated_at.timestamp())

    def step(self, now_s: float, findings: Iterable[Finding], party: Callable[[str], tuple[str, str]]) -> list[Told]:
        """The revisions that this look makes, by key. `party` gives the name and vendor of a robot that is known."""
        if self._restored:
            self._restored = False
            for track in self._tracks.values():
                track.found_s = now_s + RESTORED_S - self._clear_after_s
        found = {one.key: one for one in findings}
        revisions: list[Told] = []
        for key in sorted(found.keys() | self._tracks.keys()):
            track = self._tracks.setdefault(key, _Track())
            track.looks.append(key in found)
            revision = self._advance(track, found.get(key), now_s, party)
            if revision:
                revisions.append(revision)
                track.advisory = None if revision.state is AdvisoryState.CLEARED else revision
            if track.advisory is None and not any(track.looks):
                del self._tracks[key]
        return revisions

    def _advance(
        self, track: _Track, finding: Finding | None, now_s: float, party: Callable[[str], tuple[str, str]]
    ) -> Told | None:
        before = track.advisory
        if finding:
            track.found_s = max(track.found_s, now_s)
            if before:
                return _updated(before, finding, now_s, party)
            return _raised(finding, now_s, party) if sum(track.looks) >= WANTED else None
        if before and now_s - track.found_s >= self._clear_after_s:
            return before.ended(now_s, OVER[before.kind])
        return None


def finding_key(one: Told) -> str:
    """The `Finding.key` of what an advisory is about."""
    if isinstance(one, ContentionAdvisory):
        return f"{one.kind} {one.resource}"
    if isinstance(one, ClaimAdvisory):
        return f"{one.kind} {about_claim(one.owner, one.claimant)}"
    return f"{one.kind} {one.blocker if isinstance(one, BlockageAdvisory) else ' '.join(one.robots)}"


def about_claim(owner: str, claimant: str) -> str:
    return json.dumps([owner, claimant])


def _fields(finding: Finding, now_s: float, party: Callable[[str], tuple[str, str]]) -> dict[str, Any]:
    parties = [party(uuid) for uuid in finding.robots]
    return {
        "severity": finding.severity,
        "robots": finding.robots,
        "names": tuple(name for name, _ in parties),
        "vendors": tuple(vendor for _, vendor in parties),
        "updated_at": moment(now_s),
        "predicted_at": moment(finding.predicted_s),
        "time_to_conflict_s": _left_s(finding, now_s),
        "location": finding.location,
        "summary": finding.summary(),
        "recommendation": finding.recommendation,
        **finding.evidence,
    }


def _raised(finding: Finding, now_s: float, party: Callable[[str], tuple[str, str]]) -> Told:
    return MODELS[finding.kind](
        id=str(uuid5(ADVISORIES, f"{finding.key} {round(now_s * 1e6)}")),
        kind=finding.kind,
        revision=1,
        state=AdvisoryState.RAISED,
        raised_at=moment(now_s),
        **_fields(finding, now_s, party),
    )


def _updated(before: Told, finding: Finding, now_s: float, party: Callable[[str], tuple[str, str]]) -> Told | None:
    rises = SEVERITIES.index(finding.severity) > SEVERITIES.index(before.severity)
    advice = finding.recommendation
    other = advice is not None and advice is not before.recommendation
    anew = other and _order(advice) != _order(before.recommendation)
    if not rises and now_s - before.updated_at.timestamp() < (ADVICE_GAP_S if anew else UPDATE_GAP_S):
        return None
    if not rises and not anew and not _differs(before, finding, now_s):
        return None
    return before.followed(**_fields(finding, now_s, party))


def _differs(before: Told, finding: Finding, now_s: float) -> bool:
    """Whether a person or a site service would act otherwise on the new telling."""
    left_s = max(before.predicted_at.timestamp() - now_s, 0.0)
    moved_s = abs((moment(finding.predicted_s) - before.predicted_at).total_seconds())
    begun = before.time_to_conflict_s == 0 and _left_s(finding, now_s) == 0
    if not begun and moved_s > max(MOVED_S, MOVED_SHARE * left_s):
        return True
    if finding.severity != before.severity or finding.robots != before.robots:
        return True
    told = finding.evidence
    if isinstance(before, ContentionAdvisory):
        longer_s = abs(told["wait_s"] - before.wait_s)
        return bool(longer_s > max(MOVED_S, MOVED_SHARE * before.wait_s) or told["queue_length"] != before.queue_length)
    if isinstance(before, BlockageAdvisory):
        return bool(told["holds_up"] != before.holds_up)
    if isinstance(before, ClaimAdvisory):
        return bool(told["claimed"] >= 2 * before.claimed)
    return [(one.waiter, one.holder) for one in told["cycle"]] != [(one.waiter, one.holder) for one in before.cycle]


def _left_s(finding: Finding, now_s: float) -> float:
    return round(max(finding.predicted_s - now_s, 0.0), 3)


def _order(advice: Recommendation | None) -> list[tuple[str, str]]:
    return [(slot.robot, slot.resource) for slot in advice.slots] if advice else []
