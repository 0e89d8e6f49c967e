"""Smallest separation over a time, by branch and bound with the directional bound of `deconflict/advance.py`."""

import numpy as np

from deconflict.relative import Relative
from ingest.seam import Floats, Ints

ACCURACY_M = 1e-3
MOST_HALVINGS = 40


def smallest(motion: Relative, owner: Ints, owners: int) -> tuple[Floats, Floats]:
    """For each of `owners`, over the segment pairs that it owns: the smallest distance and when, (owners,) each.

    To `ACCURACY_M`; 0 where the rectangles overlap, and then at a time at which they do. Times are seconds into the
    slab. Each owner's pairs must follow one another in time.
    """
    best, when = np.full(owners, np.inf), np.zeros(owners)
    rows, low, high = np.arange(len(motion)), motion.begin, motion.end
    for end in (low, high):
        _improve(best, when, owner, motion.gap_at(end).distance, end)
    for _ in range(MOST_HALVINGS):
        if not len(rows):
            break
        part = motion.take(rows)
        middle, half = (low + high) / 2, (high - low) / 2
        there = part.gap_at(middle)
        _improve(best, when, owner[rows], there.distance, middle)
        drift = np.abs(part.vx * there.nx + part.vy * there.ny) + part.swing
        drift = np.where(there.distance > 0, drift, np.hypot(part.vx, part.vy) + part.swing)
        bound = there.distance - drift * half
        open_ = (bound < best[owner[rows]] - ACCURACY_M) & (best[owner[rows]] > 0)
        rows, low, middle, high = rows[open_], low[open_], middle[open_], high[open_]
        rows, low, high = np.concatenate([rows, rows]), np.concatenate([low, middle]), np.concatenate([middle, high])
    return best, when


def _improve(best: Floats, when: Floats, owner: Ints, distance: Floats, t: Floats) -> None:
    """Lower `best` where `distance` is smaller; of equal ones the earliest time counts."""
    order = np.lexsort((t, distance, owner))
    first = np.ones(len(order), bool)
    first[1:] = owner[order][1:] != owner[order][:-1]
    rows = order[first]
    better = (distance[rows] < best[owner[rows]]) | (
        (distance[rows] == best[owner[rows]]) & (t[rows] < when[owner[rows]])
    )
    rows = rows[better]
    best[owner[rows]], when[owner[rows]] = distance[rows], t[rows]
