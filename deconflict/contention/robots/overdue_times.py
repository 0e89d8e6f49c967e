"""How much longer an overdue robot takes that stands, learned by vendor from late arrivals and a prior.

The time left to a robot is taken from arrivals that were later than it is already: it is what was left to them. By the
prior, about as much time is left as the robot is overdue (what has lasted long lasts long), but waits also end at a
constant rate. That rate is learned from the latest quarter of the arrivals, so that many short waits predict long ones,
which are rare.
"""

from collections import deque

import numpy as np

from deconflict.runtime.learned_state import Form, Part, Seconds
from ingest.batch import Floats

MOST_ARRIVALS = 200
"""Late arrivals that are kept for one vendor."""
HALF_LIFE_S = 86400.0
PRIOR_ARRIVALS, PRIOR_WAIT_S = 2.0, 600.0
"""The prior of the rate at which waits end: so many arrivals, with this mean wait."""
LATER_FROM = 0.75
"""The rate is learned from the arrivals that were later than this share of all."""
LEAST_LATE_S, LEAST_WAIT_S = 10.0, 30.0
"""Less late arrivals are not used for the rate; the mean wait is at least the second number."""
PRIOR_LATER: Floats = np.array([0.9, 0.7, 0.5, 0.3, 0.1])
"""The prior counts as five new arrivals; the time left exceeds theirs with these probabilities."""
SHARES: Floats = np.array([0.1, 0.5, 0.9])
OVERDUE_S: Floats = np.concatenate([[0.0], 2.5 * 2.0 ** np.arange(12)])
"""Rows of the table: up to an hour and a half, in steps that double."""
_LEAST_GROWN, _ROUNDS = 1e-300, 6
"""In place of 0; and the number of Newton's steps, after which the last digits stand."""
FORM = Form("when late arrivals were, and by how many seconds", {"late": dict[str, list[tuple[Seconds, Seconds]]]})


class OverdueTimes:
    """How late the robots of each vendor came."""

    def __init__(self) -> None:
        self._seen: dict[str, deque[tuple[float, float]]] = {}
        """By vendor: when a late arrival was, and how late it was."""
        self._tables: dict[str, Floats] = {}
        """By vendor, the table that was asked for since its last late arrival."""

    def record(self, vendor: str, late_s: float, now_s: float) -> None:
        """Record an arrival: how late it was by the last announcement; in time if that is not above 0."""
        if late_s > 0:
            self._seen.setdefault(vendor, deque(maxlen=MOST_ARRIVALS)).append((now_s, late_s))
            self._tables.pop(vendor, None)

    def table_s(self, vendor: str) -> Floats:
        """(len(OVERDUE_S), len(SHARES)) quantiles of the time left to a robot that is overdue for these times."""
        if vendor not in self._tables:
            at_s, late_s = np.array(self._seen.get(vendor, ())).reshape(-1, 2).T
            weights = 0.5 ** ((at_s.max(initial=0.0) - at_s) / HALF_LIFE_S)
            self._tables[vendor] = _left_s(late_s, weights)
        return self._tables[vendor]

    def learned(self) -> Part:
        """By vendor, when late arrivals were, and how late they were."""
        return FORM.part({"late": {vendor: list(seen) for vendor, seen in self._seen.items()}})

    def resume(self, part: Part) -> None:
        """Continue from what `learned` gave. Raises `UnreadableError`."""
        for vendor, late in FORM.checked(part)["late"].items():
            self._seen[vendor] = deque(late, maxlen=MOST_ARRIVALS)
        self._tables.clear()


def _left_s(late_s: Floats, weights: Floats) -> Floats:
    """(len(OVERDUE_S), len(SHARES)) quantiles of the time left, by late arrivals (n,), their weights, and the prior."""
    seen_s, prior_s = late_s - OVERDUE_S[:, None], prior_left_s(_end_rate(late_s, weights))
    left_s = np.concatenate([seen_s, prior_s], axis=1)
    counts = np.concatenate([weights * (seen_s > 0), np.ones_like(prior_s)], axis=1)
    order = np.argsort(left_s, axis=1)
    so_far = np.cumsum(np.take_along_axis(counts, order, axis=1), axis=1)
    reached = so_far[:, :, None] >= SHARES * so_far[:, -1:, None]
    return np.take_along_axis(np.take_along_axis(left_s, order, axis=1), reached.argmax(axis=1), axis=1)


def prior_left_s(end_rate: float) -> Floats:
    """(len(OVERDUE_S), len(PRIOR_LATER)) the time left by the prior, if waits also end at `end_rate`.

    The probability to be later than t falls as exp(-rate t) / t; this is solved for t by Lambert's W, w exp(w) = x.
    Newton's steps are those of Iacono and Boyd, "New approximations to the principal real-valued branch of the Lambert
    W-function", 2017.
    """
    overdue_s = OVERDUE_S[:, None]
    grown = np.maximum(end_rate * overdue_s / PRIOR_LATER * np.exp(end_rate * overdue_s), _LEAST_GROWN)
    w = np.log1p(grown)
    for _ in range(_ROUNDS):
        w *= (1.0 + np.log(grown / w)) / (1.0 + w)
    left_s = np.where(overdue_s > 0.0, w / end_rate - overdue_s, 0.0)
    return np.maximum(left_s, 0.0)


def _end_rate(late_s: Floats, weights: Floats) -> float:
    """How many more waits end in a second than if the probability to be later than t fell as 1 / t."""
    from_s = max(float(np.quantile(late_s, LATER_FROM)) if len(late_s) else 0.0, LEAST_LATE_S)
    is_later = late_s > from_s
    later_s, counts = late_s[is_later], weights[is_later]
    beyond = max(float(counts.sum() - counts @ np.log(later_s / from_s)), 0.0)
    waited_s = float(counts @ (later_s - from_s))
    return min((beyond + PRIOR_ARRIVALS) / (waited_s + PRIOR_ARRIVALS * PRIOR_WAIT_S), 1.0 / LEAST_WAIT_S)
