"""Situations over a long time on a busy floor: whether every id is raised once, cleared once and never used again, and
what a pass costs.

    python -m benchmarks.situations --hours 24 --open 30

Draws conflicts that begin at crossings, move, share robots and end, and takes them through `SituationLifecycle` once a
second. It stops with an error at the first fault.
"""

import argparse
import json
import time
from collections import Counter
from datetime import UTC, datetime

import numpy as np

from deconflict.advisories.situations.situation_lifecycle import SituationLifecycle
from deconflict.advisories.words.words import Spot
from deconflict_client.advisory import (
    AdvisoryState,
    ClearedCode,
    ConflictAdvisory,
    EncounterClass,
    Location,
    Severity,
    moment,
)
from deconflict_client.situations import Situation

START_S = datetime(2026, 5, 1, tzinfo=UTC).timestamp()
LASTS_S = 12.0
"""Mean duration of a conflict."""
CROSSINGS = 12
SPREAD_M, STEP_M = 4.0, 1.5
"""How far conflicts begin from their crossing, and how far they move in a second."""
FAR_M = 60.0
RESTARTED_S = 3600
"""The lifecycle is restored from what is open once in this time."""


class Floor:
    """Open conflicts of `robots` robots, `open_count` of them on average."""

    def __init__(self, robots: int, open_count: float, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._robots, self._rate = robots, open_count / LASTS_S
        self._crossings = self._rng.uniform(0.0, FAR_M, (CROSSINGS, 2))
        self.open: dict[str, ConflictAdvisory] = {}
        self.raised = 0

    def advance(self, now_s: float) -> list[ConflictAdvisory]:
        """The revisions of one second."""
        ended = [each for each in self.open.values() if self._rng.random() < 1 / LASTS_S]
        for conflict in ended:
            del self.open[conflict.id]
        moved = [self._moved(each, now_s) for each in self.open.values() if self._rng.random() < 0.2]
        raised = [self._raised(now_s) for _ in range(self._rng.poisson(self._rate))]
        self.open |= {each.id: each for each in (*moved, *raised)}
        return [*(each.cleared_revision(now_s, ClearedCode.PASSED) for each in ended), *moved, *raised]

    def _raised(self, now_s: float) -> ConflictAdvisory:
        self.raised += 1
        x_m, y_m = self._crossings[self._rng.integers(CROSSINGS)] + self._rng.normal(0.0, SPREAD_M, 2)
        pair = sorted(self._rng.choice(self._robots, 2, replace=False).tolist())
        left_s = float(self._rng.uniform(1.0, 10.0))
        a, b = (f"robot-{number:04}" for number in pair)
        return ConflictAdvisory(
            id=f"conflict-{self.raised}",
            revision=1,
            state=AdvisoryState.RAISED,
            severity=Severity.WARNING,
            robots=(a, b),
            names=(a, b),
            vendors=("Alder", "Birch"),
            raised_at=moment(now_s),
            updated_at=moment(now_s),
            predicted_at=moment(now_s + left_s),
            time_to_conflict_s=left_s,
            location=Location(datum="hall", x=x_m, y=y_m),
            summary=f"{a} and {b} cross",
            encounter=1,
            encounter_class=EncounterClass.CROSSING,
            basis=("path", "path"),
            probability=float(self._rng.uniform(0.3, 1.0)),
            clearance_m=0.3,
            min_separation_m=0.0,
            closing_speed_mps=1.0,
        )

    def _moved(self, conflict: ConflictAdvisory, now_s: float) -> ConflictAdvisory:
        dx_m, dy_m = self._rng.normal(0.0, STEP_M, 2)
        place = conflict.location.model_copy(update={"x": conflict.location.x + dx_m, "y": conflict.location.y + dy_m})
        return conflict.next_revision(location=place, updated_at=moment(now_s))


class FaultError(Exception):
    """An id of a situation is lost, doubled or used again."""


class Ledger:
    """Every id so far. Raises `FaultError` at the first fault."""

    def __init__(self) -> None:
        self.open: dict[str, Situation] = {}
        self.counts: Counter[str] = Counter()
        self._cleared: set[str] = set()

    def add(self, revision: Situation) -> None:
        before = self.open.pop(revision.id, None)
        if revision.id in self._cleared:
            raise FaultError(f"{revision.id} is used again")
        if revision.revision != (before.revision + 1 if before else 1):
            raise FaultError(f"{revision.id} lacks a revision")
        if (revision.state is AdvisoryState.RAISED) is not (before is None):
            raise FaultError(f"{revision.id} is raised twice")
        self.counts["revisions"] += 1
        self.counts["split"] += before is None and revision.split_from is not None
        if revision.state is AdvisoryState.CLEARED:
            self._cleared.add(revision.id)
        else:
            self.open[revision.id] = revision

    @property
    def situations(self) -> int:
        return len(self._cleared) + len(self.open)


def restored(lifecycle: SituationLifecycle, floor: Floor) -> SituationLifecycle:
    after = new_lifecycle()
    after.restore(lifecycle.open(), floor.open.values())
    return after


def new_lifecycle() -> SituationLifecycle:
    return SituationLifecycle(lambda points: [Spot("in the hall")] * len(points))


def run(hours: float, robots: int, open_count: float, seed: int) -> dict[str, object]:
    floor, ledger, lifecycle = Floor(robots, open_count, seed), Ledger(), new_lifecycle()
    used_s, open_now = 0.0, []
    for second in range(round(hours * 3600)):
        now_s = START_S + second
        if second % RESTARTED_S == RESTARTED_S - 1:
            lifecycle = restored(lifecycle, floor)
        revisions = floor.advance(now_s)
        began_s = time.perf_counter()
        situations = lifecycle.revise(now_s, revisions)
        used_s += time.perf_counter() - began_s
        for revision in situations:
            ledger.add(revision)
        if {each.id for each in lifecycle.open()} != ledger.open.keys():
            raise FaultError("an open situation is lost")
        open_now.append(len(ledger.open))
    return {
        "hours": hours,
        "advisories": floor.raised,
        "situations": ledger.situations,
        **ledger.counts,
        "open_median": float(np.median(open_now)),
        "pass_us": round(used_s / len(open_now) * 1e6),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0, help="log time")
    parser.add_argument("--robots", type=int, default=300, help="robots on the floor")
    parser.add_argument("--open", type=float, default=30.0, help="open conflicts on average")
    parser.add_argument("--seed", type=int, default=1, help="seed of the drawn conflicts")
    args = parser.parse_args()
    print(json.dumps(run(args.hours, args.robots, args.open, args.seed)))


if __name__ == "__main__":
    main()
