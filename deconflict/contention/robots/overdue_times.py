"""How much longer a robot takes that stands and is past the time it told: learned by vendor, from a prior on.

Each arrival that came late says by how much. Of those that were later than a robot is already, what was left to them is
what may be left to it. The prior is that about as much is left as it is overdue (what has lasted long lasts long), but
that waits also end at a constant rate, however long they have lasted. That rate is learned from the latest quarter of
the arrivals, so that many short waits tell of long ones, of which few are seen.
"""

from collections import deque

import numpy as np
from scipy.special import lambertw

from deconflict.runtime.learned_state import Part, numbers
from ingest.batch import Floats

MOST_ARRIVALS = 200
"""Late ones, kept of one vendor."""
HALF_LIFE_S = 86400.0
PRIOR_ARRIVALS, PRIOR_WAIT_S = 2.0, 600.0
"""What is thought of the rate at which waits end of a vendor of which nothing has been seen."""
LATER_FROM = 0.75
"""It is learned from the arrivals that were later than this share of all."""
LEAST_LATE_S, LEAST_WAIT_S = 10.0, 30.0
"""Arrivals that were less late tell nothing of how long waits last; nor do waits end sooner on average."""
PRIOR_LATER: Floats = np.array([0.9, 0.7, 0.5, 0.3, 0.1])
"""The prior is five arrivals just seen: what is left is more than theirs with these chances."""
SHARES: Floats = np.array([0.1, 0.5, 0.9])
OVERDUE_S: Floats = np.concatenate([[0.0], 2.5 * 2.0 ** np.arange(12)])
"""Where the table is worked out: up to an hour and a half, in steps that double."""


class Overdue:
    """By vendor, how late its robots came."""

    def __init__(self) -> None:
        self._seen: dict[str, deque[tuple[float, float]]] = {}
        """When an arrival was seen, and how late it was."""
        self._tables: dict[str, Floats] = {}
        """Those that were asked for, of vendors of whose robots none has come late since."""

    def record(self, vendor: str, late_s: float, now_s: float) -> None:
        """A robot has come, so late by what it had told last; in time where that is not above 0."""
        if late_s > 0:
            self._seen.setdefault(vendor, deque(maxlen=MOST_ARRIVALS)).append((now_s, late_s))
            self._tables.pop(vendor, None)

    def table_s(self, vendor: str) -> Floats:
        """(len(OVERDUE_S), len(SHARES)) quantiles of what is left to a robot that is so long overdue."""
        if vendor not in self._tables:
            at_s, late_s = np.array(self._seen.get(vendor, ())).reshape(-1, 2).T
            weights = 0.5 ** ((at_s.max(initial=0.0) - at_s) / HALF_LIFE_S)
            self._tables[vendor] = _left_s(late_s, weights)
        return self._tables[vendor]

    def learned(self) -> Part:
        """By vendor, when late arrivals were seen, and how late they were."""
        return {vendor: list(seen) for vendor, seen in self._seen.items()}

    def resume(self, part: Part) -> None:
        """Go on with what `learned` told. Raises `UnreadableError`."""
        for vendor in part:
            rows = numbers(part, vendor, (None, 2)).tolist()
            self._seen[vendor] = deque(((at_s, late_s) for at_s, late_s in rows), maxlen=MOST_ARRIVALS)
        self._tables.clear()


def _left_s(late_s: Floats, weights: Floats) -> Floats:
    """(len(OVERDUE_S), len(SHARES)) quantiles of what is left, by arrivals (n,) so late and of such weights, and by the
    prior."""
    seen_s, prior_s = late_s - OVERDUE_S[:, None], _prior_s(_end_rate(late_s, weights))
    left_s = np.concatenate([seen_s, prior_s], axis=1)
    counts = np.concatenate([weights * (seen_s > 0), np.ones_like(prior_s)], axis=1)
    order = np.argsort(left_s, axis=1)
    so_far = np.cumsum(np.take_along_axis(counts, order, axis=1), axis=1)
    reached = so_far[:, :, None] >= SHARES * so_far[:, -1:, None]
    found: Floats = np.take_along_axis(np.take_along_axis(left_s, order, axis=1), reached.argmax(axis=1), axis=1)
    return found


def _prior_s(end_rate: float) -> Floats:
    """(len(OVERDUE_S), len(PRIOR_LATER)) what the prior says is left, where waits end at such a rate besides.

    The chance to be later than t falls as exp(-rate t) / t; solved for t.
    """
    overdue_s = OVERDUE_S[:, None]
    grown = end_rate * overdue_s / PRIOR_LATER * np.exp(end_rate * overdue_s)
    left_s: Floats = np.real(lambertw(grown)) / end_rate - overdue_s
    return np.maximum(left_s, 0.0)


def _end_rate(late_s: Floats, weights: Floats) -> float:
    """How many waits end in a second beyond those that would if the chance to be later than t fell as 1 / t."""
    from_s = max(float(np.quantile(late_s, LATER_FROM)) if len(late_s) else 0.0, LEAST_LATE_S)
    is_later = late_s > from_s
    later_s, counts = late_s[is_later], weights[is_later]
    beyond = max(float(counts.sum() - counts @ np.log(later_s / from_s)), 0.0)
    waited_s = float(counts @ (later_s - from_s))
    return min((beyond + PRIOR_ARRIVALS) / (waited_s + PRIOR_ARRIVALS * PRIOR_WAIT_S), 1.0 / LEAST_WAIT_S)
