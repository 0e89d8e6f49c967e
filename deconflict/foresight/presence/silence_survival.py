"""How long silences last that end where the robot was: what share of them lasts longer than the one that is under way.

Counts of such silences by how long they lasted, beside a prior: half of the silences that outlast 5 s end within 20 s,
and the tail is heavy (log-logistic).
"""

import numpy as np

from ingest.batch import Floats

EDGES_S: Floats = 5.0 * 2.0 ** (np.arange(31) / 2)
"""Lasting longer than each of these, up to two days."""
MEDIAN_S = 10.0
PRIOR_CASES = 4.0
MEMORY_CASES = 100.0
"""Where more are counted, the old ones lose weight."""


def took_in(counts: Floats, lasted_s: float) -> Floats:
    """The counts (len(EDGES_S),), from each edge to the next, with one more silence."""
    counts = counts * min(MEMORY_CASES / (counts.sum() + 1.0), 1.0)
    counts[max(int(np.searchsorted(EDGES_S, lasted_s, "right")) - 1, 0)] += 1.0
    return counts


def share_longer(counts: Floats, lasted_s: float, least_s: float) -> float:
    """Of the silences that outlast `least_s` and end, the share that outlasts `lasted_s` too."""
    at_least = _cases_longer(counts, least_s)
    return min(_cases_longer(counts, max(lasted_s, least_s)) / at_least, 1.0)


def _cases_longer(counts: Floats, lasted_s: float) -> float:
    """Cases and prior cases that outlast a time; within a bin they are spread evenly over the logarithm of time."""
    share_of_bin = np.clip(np.log(lasted_s / EDGES_S) / np.log(EDGES_S[1] / EDGES_S[0]), 0.0, 1.0)
    return float(counts @ (1.0 - share_of_bin)) + PRIOR_CASES / (1.0 + lasted_s / MEDIAN_S)
