"""How many meetings of a phase were warned of, and by which faces."""

import asyncio
import os
import time
from collections import Counter
from collections.abc import Sequence
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
    "phase", "meetings", "not 2 s ahead at face 1", "2", "3", "late everywhere", "unwarned everywhere",
    "of these apart", "joined", "broken bounds", "health", "load",
)  # fmt: skip


@dataclass(frozen=True)
class PhaseScore:
    phase: str
    meetings: int
    missed_at: list[int]
    """At each face, the meetings that were not warned of `AHEAD_S` before."""
    late: int
    """Warned of at some face, and at none `AHEAD_S` before."""
    unwarned: int
    """At no face."""
    apart: int
    """Of those that are late or unwarned: the two robots of the pair report to two machines."""
    joined: int
    """With the advisory of the meeting before."""
    health: dict[str, int]
    """How often the faces said what of themselves."""
    load: float
    broken: list[str]


def cells(score: PhaseScore) -> tuple[Any, ...]:
    """A row of the table."""
    health = ", ".join(f"{said} {count}" for said, count in sorted(score.health.items()))
    return (
        score.phase, score.meetings, *score.missed_at, score.late, score.unwarned, score.apart, score.joined,
        len(score.broken), health, score.load,
    )  # fmt: skip


def score(
    phase: DrillPhase,
    pairs: Sequence[CrossingPair],
    faces: Sequence[WatchedFace],
    start_s: float,
    began_s: float,
    repaired_s: float,
    ended_s: float,
) -> PhaseScore:
    """The figures of a phase between two times."""
    missed_at, late, unwarned, apart, joined, charged = [0] * len(faces), 0, 0, 0, 0, 0
    meetings = [(p, start_s + t_s) for p in pairs for t_s in p.meetings_s(began_s - start_s, ended_s - start_s)]
    for pair, at_s in meetings:
        warned_s = [face.warned_s(pair.uuids, at_s) for face in faces]
        is_missed = [seconds is None or seconds < AHEAD_S for seconds in warned_s]
        missed_at = [count + missed for count, missed in zip(missed_at, is_missed, strict=True)]
        joined += any(face.ids(pair.uuids, at_s) & face.ids(pair.uuids, at_s - GAP_S) for face in faces)
        if all(is_missed):
            is_apart = pair.machines[0] != pair.machines[1]
            is_spared = at_s < repaired_s + GRACE_S and (phase.spares_all or (phase.spares_apart and is_apart))
            is_unwarned = all(seconds is None for seconds in warned_s)
            unwarned, late = unwarned + is_unwarned, late + (not is_unwarned)
            apart, charged = apart + is_apart, charged + (not is_spared)
    broken = [f"{charged} of {len(meetings)} meetings were warned of too late, or not"] if charged else []
    broken += [f"{joined} meetings have the advisory of the one before"] if joined else []
    looks = Counter(said for face in faces for at_s, said in face.health if began_s <= at_s < ended_s)
    load = round(os.getloadavg()[0], 1)
    return PhaseScore(phase.name, len(meetings), missed_at, late, unwarned, apart, joined, dict(looks), load, broken)


async def differences(faces: Sequence[WatchedFace]) -> int:
    """The number of advisories that not all faces have alike, if they are not alike within a while."""
    until_s = time.monotonic() + ALIKE_WITHIN_S
    while (found := _different([await face.stored() for face in faces])) and time.monotonic() < until_s:
        await asyncio.sleep(1.0)
    return found


def _different(stored: Sequence[dict[str, Any]]) -> int:
    ids = {each for at_face in stored for each in at_face}
    return sum(len({str(at_face.get(each)) for at_face in stored}) > 1 for each in ids)
