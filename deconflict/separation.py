"""Smallest separation over a time, by branch and bound with the directional bound of `deconflict/advance.py`."""

import numpy as np

from deconflict.relative import Relative
from ingest.seam import Floats, Ints

ACCURACY_M = 1e-3
MOST_HALVINGS = 40


def smallest(motion: Relative, owner: Ints, owners: int) -> tuple[Floats, Floats]:
    """For each of `owners`, over the segment pairs that it owns: the smallest distance and when, (owners,) each.

    To `ACCURACY_M`; 0 where the rectangles overlap, and then at a time at which they do. Times are seconds into the
    slab.
    """
    best, when = np.full(owners, np.inf), np.zeros(owners)
    at = motion.begin + motion.nearest_centres_after()
    over = motion.apart_at(at, 0.0).gap <= 0
    _improve(best, when, owner[over], np.zeros(int(over.sum())), at[over])
    rows = np.flatnonzero(best[owner] > 0)
    part, low, high = motion.take(rows), motion.begin[rows], motion.end[rows]
    for end in (low, high):
        _improve(best, when, owner[rows], part.gap_at(end).distance, end)
    for _ in range(MOST_HALVINGS):
        if not len(rows):
            break
        middle, half = (low + high) / 2, (high - low) / 2
        there = part.gap_at(middle)
        _improve(best, when, owner[rows], there.distance, middle)
        drift = np.abs(part.vx * there.nx + part.vy * there.ny) + part.swing
        drift = np.where(there.distance > 0, drift, np.hypot(part.vx, part.vy) + part.swing)
        so_far = best[owner[rows]]
        open_ = np.flatnonzero((there.distance - drift * half < so_far - ACCURACY_M) & (so_far > 0))
        low, middle, high = low[open_], middle[open_], high[open_]
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        again = np.concatenate([open_, open_])
        rows, part = rows[again], part.take(again)
    return best, when


def _improve(best: Floats, when: Floats, owner: Ints, distance: Floats, t: Floats) -> None:
    """Lower `best` where `distance` is smaller; of equal ones the earliest time counts."""
    better = np.flatnonzero(distance < best[owner])
    owner, distance, t = owner[better], distance[better], t[better]
    np.minimum.at(best, owner, distance)
    reached = distance == best[owner]
    when[owner[reached]] = np.inf
    np.minimum.at(when, owner[reached], t[reached])
