"""Which pairs get in each other's way when all robots near each other are driven on together."""

from typing import NamedTuple

import numpy as np

from deconflict.foresight.rollout.drive_kernels import drive, edges_of, reaches
from deconflict.foresight.rollout.start_samples import SAMPLES, paces
from ingest.batch import Bools, Floats, Ints

NOBODY = -1
ROLLED = 1
"""Features of a pair: the log odds of getting in each other's way within the horizon."""
PRIOR = 0.3
"""Samples that count for, and against, before any is driven."""


class RolloutInput(NamedTuple):
    """n robots that are driven on together. Arrays are (n,) but for some."""

    slot: Ints
    key: Ints
    """As `key_of` gives."""
    since_s: Floats
    """How long ago each track began."""
    track: Floats
    """(n, k, 4) x_m, y_m, yaw_rad and floor, every second."""
    half: Floats
    """(2, n) half sides."""
    levels_m: Floats
    """(2, n) bottom and top."""
    stands: Bools
    starts_s: Floats
    """(SAMPLES, n) when each starts at the earliest, in each sample."""


class RolloutResult(NamedTuple):
    """What came of it, of p pairs of slots."""

    a: Ints
    """(p,) the slots of each pair, in no order."""
    b: Ints
    seen: Floats
    """(p, ROLLED) features."""
    waits_for: Ints
    """(n,) for whose slot each robot that stands has to wait now, `NOBODY` where for none."""


def run_rollout(crowd: RolloutInput, horizon_s: float, clearance_m: float) -> RolloutResult:
    """Drive a crowd through the horizon."""
    box, reach_m = reaches(crowd.since_s, crowd.track, crowd.half, horizon_s, clearance_m)
    floor = np.ascontiguousarray(crowd.track[:, 0, 3])
    edges, first = edges_of(box, np.argsort(box[:, 0], kind="stable"), crowd.levels_m, floor)
    ways = (reach_m, crowd.since_s, crowd.track, crowd.half)
    edge = drive(edges, first, *ways, crowd.stands, crowd.starts_s, paces(crowd.key), horizon_s, clearance_m)
    waits_for = np.full(len(edge), NOBODY)
    waiting = edge >= 0
    waits_for[waiting] = crowd.slot[edges["other"][edge[waiting]]]
    kept = edges[edges["pair"] == np.arange(len(edges))]
    seen = _log_odds(kept["gave_way"][:, None])
    return RolloutResult(crowd.slot[kept["robot"]], crowd.slot[kept["other"]], seen, waits_for)


def _log_odds(counts: Floats) -> Floats:
    odds: Floats = np.log((counts + PRIOR) / (SAMPLES - counts + PRIOR))
    return odds


NEVER: Floats = _log_odds(np.zeros(ROLLED))
"""Features of a pair that was not driven, since nobody is near."""
