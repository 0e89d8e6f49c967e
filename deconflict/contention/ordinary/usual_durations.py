"""How long something usually lasts, by place and part of the day, learned in bounded memory.

There is a histogram for each place and part of the day. Where few durations are known, the next wider group completes
them: the whole day at the place, then all places, then a prior in which what has lasted long lasts long.
"""

from collections import OrderedDict
from dataclasses import dataclass, field
from math import inf

import numpy as np

from deconflict.runtime.learned_state import Form, Part, count_column, time_column
from ingest.batch import Floats

BINS, STEP = 40, 1.25
EDGES_S: Floats = np.power(STEP, np.arange(1, BINS + 1, dtype=np.float64))
"""(BINS,) upper edge of each bin; the last bin also has everything beyond two hours."""
STARTS_S: Floats = np.concatenate([[0.0], EDGES_S[:-1]])
"""(BINS,) lower edge."""
DAY_S, PARTS = 86400.0, 6
"""A day has so many parts, from midnight UTC on."""
USUAL_SHARE = 0.9
"""This share of the durations is usual."""
WEIGHT = 5.0
"""A wider group completes a narrower one with the weight of so many durations."""
HALF_LIFE_S = 14 * DAY_S
MOST_PLACES = 1000
"""At more places, those without a duration for longest are forgotten."""
FORM = Form(
    f"durations by {PARTS} parts of a day and {BINS} bins from 1 s on by {STEP:g}, all places first",
    {"places": list[str]},
    {"at_s": time_column("places+1"), "counts": count_column("places+1", PARTS, BINS)},
)


@dataclass(slots=True, eq=False)
class _PlaceDurations:
    """The durations at one place."""

    at_s: float
    """When the counts were last faded, seconds since the epoch."""
    counts: Floats = field(default_factory=lambda: np.zeros((PARTS, BINS)))
    """By part of the day and bin."""

    def faded(self, now_s: float) -> Floats:
        """The counts, as much as they weigh now."""
        return self.counts * 0.5 ** (max(now_s - self.at_s, 0.0) / HALF_LIFE_S)


class UsualDurations:
    """The durations at every place."""

    def __init__(self, usual_s: float) -> None:
        """Where nothing is known, `USUAL_SHARE` of the durations are shorter than `usual_s`."""
        scale_s = usual_s * (1 / USUAL_SHARE - 1)
        longer = scale_s / (scale_s + np.array([*STARTS_S, inf]))
        self._prior: Floats = -np.diff(longer)
        self._places = OrderedDict[str, _PlaceDurations]()
        """The one that learned last is the last."""
        self._everywhere = _PlaceDurations(0.0)
        self.dropped = 0
        """Places that were forgotten because there were too many."""

    def __len__(self) -> int:
        return len(self._places)

    def add(self, place: str, lasted_s: float, now_s: float) -> None:
        """Add something that has ended."""
        part, column = _part(now_s), min(int(np.searchsorted(EDGES_S, lasted_s)), BINS - 1)
        for durations in (self._everywhere, self._places.setdefault(place, _PlaceDurations(now_s))):
            durations.counts = durations.faded(now_s)
            durations.at_s = now_s
            durations.counts[part, column] += 1
        self._places.move_to_end(place)
        self._forget_beyond_limit()

    def usual_s(self, place: str, now_s: float) -> float:
        """`USUAL_SHARE` of what begins at this place and hour is shorter."""
        return _quantile_s(self._shares(place, now_s), USUAL_SHARE)

    def left_s(self, place: str, elapsed_s: float, now_s: float) -> float:
        """How much longer it lasts after `elapsed_s`: half of what has lasted so long is over sooner."""
        if elapsed_s >= STARTS_S[-1]:
            return elapsed_s
        still_lasts = np.clip((EDGES_S - elapsed_s) / (EDGES_S - STARTS_S), 0.0, 1.0)
        return max(_quantile_s(still_lasts * self._shares(place, now_s), 0.5), elapsed_s) - elapsed_s

    def learned(self) -> Part:
        """The counts of every place as they were when they were last added to, the sums of all places first."""
        rows = [self._everywhere, *self._places.values()]
        at_s, counts = np.array([row.at_s for row in rows]), np.array([row.counts for row in rows])
        return FORM.part({"places": list(self._places), "at_s": at_s, "counts": counts})

    def resume(self, part: Part) -> None:
        """Continue from what `learned` gave. Raises `UnreadableError`."""
        state = FORM.checked(part)
        rows = [_PlaceDurations(t_s, row) for t_s, row in zip(state["at_s"].tolist(), state["counts"], strict=True)]
        self._everywhere = rows[0]
        self._places = OrderedDict(zip(state["places"], rows[1:], strict=True))
        self._forget_beyond_limit()

    def _shares(self, place: str, now_s: float) -> Floats:
        """(BINS,) the share of the durations at this place and hour that is in each bin."""
        groups = [self._everywhere.faded(now_s).sum(axis=0)]
        if place in self._places:
            counts = self._places[place].faded(now_s)
            groups += [counts.sum(axis=0), counts[_part(now_s)]]
        shares = self._prior
        for group in groups:
            shares = (group + WEIGHT * shares) / (group.sum() + WEIGHT)
        return shares

    def _forget_beyond_limit(self) -> None:
        while len(self._places) > MOST_PLACES:
            self._places.popitem(last=False)
            self.dropped += 1


def _quantile_s(shares: Floats, share: float) -> float:
    """The duration below which a share of `shares` (BINS,) is, with the durations of a bin spread evenly over it."""
    sums = np.cumsum(shares)
    wanted = share * sums[-1]
    column = int(np.searchsorted(sums, wanted))
    missing = (sums[column] - wanted) / shares[column]
    return float(EDGES_S[column] - missing * (EDGES_S[column] - STARTS_S[column]))


def _part(now_s: float) -> int:
    """The part of the day."""
    return int(now_s % DAY_S * PARTS / DAY_S)
