"""How long silences last that end with the robot where it was: the share that lasts longer than the present one.

Such silences are counted by their length, in addition to a prior: half of the silences that outlast 5 s end within
20 s, and the tail is heavy (log-logistic).
"""

from math import log2

import numpy as np

from ingest.batch import Floats

FIRST_EDGE_S, BINS = 5.0, 31
EDGES_S: Floats = FIRST_EDGE_S * 2.0 ** (np.arange(BINS) / 2)
"""Lower edges of the bins of the length, up to two days."""
MEDIAN_S = 10.0
"""Of the prior."""
PRIOR_CASES = 4.0
"""Cases that the prior counts as."""
MEMORY_CASES = 100.0
"""If more cases are counted, the old ones lose weight."""


def with_case(counts: Floats, lasted_s: float) -> Floats:
    """The counts (len(EDGES_S),) by bin, with one more silence."""
    counts = counts * min(MEMORY_CASES / (counts.sum() + 1.0), 1.0)
    counts[max(int(np.searchsorted(EDGES_S, lasted_s, "right")) - 1, 0)] += 1.0
    return counts


def share_longer(counts: Floats, lasted_s: float, least_s: float) -> float:
    """The share of the silences that outlast `least_s` and end, that also outlasts `lasted_s`."""
    at_least = _cases_longer(counts, least_s)
    return min(_cases_longer(counts, max(lasted_s, least_s)) / at_least, 1.0)


def _cases_longer(counts: Floats, lasted_s: float) -> float:
    """Cases and prior cases that outlast a time. Within a bin, cases are spread evenly over the logarithm of time."""
    bins = min(2.0 * log2(lasted_s / FIRST_EDGE_S), BINS) if lasted_s > FIRST_EDGE_S else 0.0
    bin_now = min(int(bins), BINS - 1)
    longer = float(counts[bin_now + 1 :].sum()) + float(counts[bin_now]) * max(bin_now + 1.0 - bins, 0.0)
    return longer + PRIOR_CASES / (1.0 + lasted_s / MEDIAN_S)
