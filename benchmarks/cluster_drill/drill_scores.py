"""How many meetings of a phase were warned of, and by which faces."""

import asyncio
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.cluster_drill.crossing_pairs import GAP_S, CrossingPair
from benchmarks.cluster_drill.drill_phases import DrillPhase
from benchmarks.cluster_drill.watched_face import AHEAD_S, WatchedFace

GRACE_S = 8.0
"""After a repair: an engine begins, and warns two seconds ahead."""
ALIKE_WITHIN_S = 30.0
"""What was decided last is at every face."""
HEADINGS = (
    "phase", "meetings", "missed at face 1", "2", "3", "late everywhere", "unwarned everywhere", "whose", "joined",
    "doubled", "charged", "health", "load",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class PassedPhase:
    """When a phase began, was mended, and ended."""

    phase: DrillPhase
    stopped_faces: frozenset[int]
    began_s: float
    mended_s: float
    ended_s: float
    load: float
    """Of this machine, at the end."""

    def spares(self, pair: CrossingPair, meeting_s: float) -> bool:
        """Whether nobody could warn of a meeting."""
        is_apart = pair.kind != "at one machine"
        return meeting_s < self.mended_s + GRACE_S and (self.phase.spares_all or (self.phase.spares_apart and is_apart))


@dataclass(frozen=True)
class PhaseScore:
    phase: str
    meetings: int
    missed_at: list[int]
    """At each face, the meetings that it was not warned of `AHEAD_S` before, also while it was stopped."""
    late: int
    """Some face was warned, and none of them `AHEAD_S` before."""
    unwarned: int
    """No face was warned."""
    whose: dict[str, int]
    """Of which kinds of pairs the late and unwarned ones are."""
    joined: int
    """With the advisory of the meeting before."""
    doubled: int
    """With a second advisory."""
    charged: int
    """Missed by a face that runs, although it could be warned."""
    health: dict[str, int]
    """How often the faces gave which status."""
    load: float

    def broken(self) -> Iterator[str]:
        """A sentence for each bound that is broken."""
        if self.charged:
            yield f"{self.phase}: {self.charged} of {self.meetings} meetings were not warned of in time"
        if self.joined:
            yield f"{self.phase}: {self.joined} meetings have the advisory of the one before"
        if self.doubled:
            yield f"{self.phase}: {self.doubled} meetings have a second advisory"

    def cells(self) -> tuple[Any, ...]:
        """A row of the table."""
        return (
            self.phase, self.meetings, *self.missed_at, self.late, self.unwarned, _counts(self.whose), self.joined,
            self.doubled, self.charged, _counts(self.health), self.load,
        )  # fmt: skip


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in sorted(counts.items()))


def score(
    passed: PassedPhase, pairs: Sequence[CrossingPair], faces: Sequence[WatchedFace], start_s: float
) -> PhaseScore:
    """The figures of a phase."""
    began_s, ended_s = passed.began_s, passed.ended_s
    missed_at, counts, whose = [0] * len(faces), Counter[str](), Counter[str]()
    meetings = [(p, start_s + t_s) for p in pairs for t_s in p.meetings_s(began_s - start_s, ended_s - start_s)]
    for pair, at_s in meetings:
        warned_s = [face.warned_s(pair.uuids, at_s) for face in faces]
        is_missed = [seconds is None or seconds < AHEAD_S for seconds in warned_s]
        missed_at = [count + missed for count, missed in zip(missed_at, is_missed, strict=True)]
        if all(is_missed):
            whose[pair.kind] += 1
            counts["unwarned" if all(seconds is None for seconds in warned_s) else "late"] += 1
        running = [missed for face, missed in enumerate(is_missed, 1) if face not in passed.stopped_faces]
        is_told_too_little = all(running) if passed.phase.spares_apart else any(running)
        counts["charged"] += is_told_too_little and not passed.spares(pair, at_s)
        ids = [(face.ids(pair.uuids, at_s), face.ids(pair.uuids, at_s - GAP_S)) for face in faces]
        counts["joined"] += any(these & those for these, those in ids)
        counts["doubled"] += any(len(these) > 1 for these, _ in ids)
    looks = Counter(status for face in faces for at_s, status in face.health if began_s <= at_s < ended_s)
    figures = {name: counts[name] for name in ("late", "unwarned", "joined", "doubled", "charged")}
    return PhaseScore(
        phase=passed.phase.name,
        meetings=len(meetings),
        missed_at=missed_at,
        whose=dict(whose),
        health=dict(looks),
        load=passed.load,
        **figures,
    )


async def differences(faces: Sequence[WatchedFace]) -> int:
    """The number of advisories that not all faces have alike, if they are not alike within a while."""
    until_s = time.monotonic() + ALIKE_WITHIN_S
    while (found := _different([await face.stored() for face in faces])) and time.monotonic() < until_s:
        await asyncio.sleep(1.0)
    return found


def _different(stored: Sequence[dict[str, Any]]) -> int:
    ids = {each for at_face in stored for each in at_face}
    return sum(len({str(at_face.get(each)) for at_face in stored}) > 1 for each in ids)
