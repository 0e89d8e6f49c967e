"""Which pairs get in each other's way when all robots that are near each other are driven on together."""

from typing import NamedTuple

import numpy as np

from deconflict.foresight.rollout.drive_kernels import drive, edges_of, pairs_beside, reaches
from deconflict.foresight.rollout.start_samples import SAMPLES, paces
from ingest.batch import Bools, Floats, Ints

NOBODY = -1
ROLLED = 1
"""Features of a pair from a rollout: the log odds of getting in each other's way within the horizon."""
MOST_BESIDE = 16
"""Of a robot with more than twice so many others that its way may meet, only the pairs under watch are driven on.
Robots that drive through each other have so many, or such that drive very fast."""
PRIOR = 0.3
"""Samples that count for, and against, before any is driven."""


class RolloutInput(NamedTuple):
    """n robots that are driven on together. Arrays are (n,) if not said otherwise."""

    slot: Ints
    key: Ints
    """See `start_samples.key_of`."""
    since_s: Floats
    """How long ago each track began."""
    track: Floats
    """(n, k, 4) x_m, y_m, yaw_rad and floor, every second."""
    half_m: Floats
    """(2, n) half length and half width."""
    levels_m: Floats
    """(2, n) bottom and top."""
    stands: Bools
    starts_s: Floats
    """(SAMPLES, n) when each robot starts at the earliest, in each sample."""
    watched: Ints
    """(p, 2) rows of the robots of each pair that is under watch because the two come near each other."""


class RolloutResult(NamedTuple):
    """What happened to p pairs of slots."""

    a: Ints
    """(p,) one slot of each pair; the two are in no order."""
    b: Ints
    """(p,) the other slot."""
    features: Floats
    """(p, ROLLED)"""
    waits_for: Ints
    """(n,) the slot of the robot that a standing robot has to wait for now; `NOBODY` if there is none."""


def run_rollout(robots: RolloutInput, horizon_s: float, clearance_m: float) -> RolloutResult:
    """Drive robots on together through the horizon."""
    box, reach_m = reaches(robots.since_s, robots.track, robots.half_m, horizon_s, clearance_m)
    floor = np.ascontiguousarray(robots.track[:, 0, 3])
    pairs = pairs_beside(box, np.argsort(box[:, 0], kind="stable"), robots.levels_m, floor)
    edges, first = edges_of(_driven(pairs, robots.watched, len(box)), len(box))
    tracks = (reach_m, robots.since_s, robots.track, robots.half_m)
    samples = (robots.stands, robots.starts_s, paces(robots.key))
    edge = drive(edges, first, *tracks, *samples, horizon_s, clearance_m)
    waits_for = np.full(len(edge), NOBODY)
    waiting = edge >= 0
    waits_for[waiting] = robots.slot[edges["other"][edge[waiting]]]
    one_of_each_pair = edges[edges["pair"] == np.arange(len(edges))]
    features = _log_odds(one_of_each_pair["gave_way"][:, None])
    return RolloutResult(
        robots.slot[one_of_each_pair["robot"]], robots.slot[one_of_each_pair["other"]], features, waits_for
    )


def _driven(pairs: Ints, watched: Ints, robots: int) -> Ints:
    """Those of `pairs` (p, 2) of so many `robots` that are driven on; `watched` (w, 2) are those under watch."""
    has_many = np.bincount(pairs.ravel(), minlength=robots) > 2 * MOST_BESIDE
    if not has_many.any():
        return pairs
    is_watched = np.isin(pairs @ (robots, 1), watched @ (robots, 1))
    return np.ascontiguousarray(pairs[is_watched | ~has_many[pairs].any(axis=1)])


def _log_odds(counts: Floats) -> Floats:
    return np.log((counts + PRIOR) / (SAMPLES - counts + PRIOR))


NEVER: Floats = _log_odds(np.zeros(ROLLED))
"""Features of a pair that was not driven on, because its robots are not near each other."""
EVEN = 0.0
"""Feature of a pair of which it is not known what driving on would show."""
