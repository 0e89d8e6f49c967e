"""When two robots were within the clearance by their own reports, and how near they came: one measure of an event for
black boxes and reports.

Time is cut into whole seconds since the epoch. An event is a run of seconds in which the two were within the clearance
at any moment, with fewer than `APART` other seconds between them. So it is the same event from whichever moment one
looks.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import ceil, floor
from typing import NamedTuple

import numpy as np

from deconflict.sweep.contact_intervals import PairConflicts
from deconflict.sweep.sweep_once import sweep
from ingest.batch import Forecasts, Pair


class NearMissTrigger:
    """Gives each pair once, until it has drawn apart by the clearance and a margin."""

    def __init__(self, clearance_m: float, apart_m: float) -> None:
        """A pair that is further apart than `apart_m` may come in again."""
        self._clearance_m, self._apart_m = clearance_m, apart_m
        self._inside: set[Pair] = set()

    def new_pairs(self, conflicts: PairConflicts) -> list[Pair]:
        """The pairs that are within the clearance now and were not in the last pass, in ascending order."""
        start_m = conflicts.start_separation_m
        rows = np.flatnonzero(start_m <= self._apart_m).tolist()
        self._inside &= {conflicts.pairs[row] for row in rows}
        within = {conflicts.pairs[row] for row in rows if start_m[row] <= self._clearance_m}
        new_pairs = sorted(within - self._inside)
        self._inside |= within
        return new_pairs


APART = 3
"""A pair that kept the clearance for this many whole seconds has met again when it next does not."""
BEFORE_S, AFTER_S = 60.0, 60.0
"""Of a longer event, only this much before and after the moment at which one looks is known."""
NOTICED_S = 3.0
"""An event may be over for this long when it is noticed."""


class NearEvent(NamedTuple):
    """Two robots within the clearance."""

    began_s: float
    """When they first were."""
    ended_s: float
    """The end of the last second in which they were."""
    separation_m: float
    """The smallest separation; 0 if their envelopes overlapped."""
    at_s: float
    """When the separation was smallest."""


def event_at(a: Forecasts, b: Forecasts, clearance_m: float, at_s: float, until_s: float) -> NearEvent | None:
    """The event of two tracks at a moment, or the next one; None if they kept the clearance from then on.

    Nothing after `until_s` is looked at.
    """
    end_s = min(at_s + AFTER_S, until_s)
    found = events(a, b, clearance_m, at_s - BEFORE_S, end_s)
    return next((event for event in found if event.ended_s >= at_s - NOTICED_S), None)


def events(a: Forecasts, b: Forecasts, clearance_m: float, begin_s: float, end_s: float) -> Iterator[NearEvent]:
    """The events of two tracks in the whole seconds between two times, in their order."""
    open_event: NearEvent | None = None
    for event in _seconds_within(a, b, clearance_m, ceil(begin_s), floor(end_s)):
        if open_event is None:
            open_event = event
        elif event.ended_s - 1.0 - open_event.ended_s >= APART:
            yield open_event
            open_event = event
        else:
            nearest = min(open_event, event, key=lambda each: (each.separation_m, each.at_s))
            open_event = nearest._replace(began_s=open_event.began_s, ended_s=event.ended_s)
    if open_event:
        yield open_event


def _seconds_within(a: Forecasts, b: Forecasts, clearance_m: float, first: int, end: int) -> Iterator[NearEvent]:
    """Each second in which two tracks are within the clearance, as an event.

    One sweep looks at all seconds at once, each moved to time 0 on a floor of its own.
    """
    floors = 1 + max(int(a.floor.max()), int(b.floor.max()))
    tracks = [
        on_floor(later(track, -second), (second - first) * floors) for second in range(first, end) for track in (a, b)
    ]
    if not tracks:
        return
    found = sweep(Forecasts.joined(tracks), now_s=0.0, horizon_s=1.0, clearance_m=clearance_m)
    track_of = np.repeat(np.arange(len(tracks)), [len(track) for track in tracks])[found.pairs]
    second_of = track_of[:, 0] // 2
    are_two = track_of[:, 0] != track_of[:, 1]
    for second in np.unique(second_of[are_two]).tolist():
        rows = np.flatnonzero(are_two & (second_of == second))
        nearest = rows[np.lexsort((found.separation_at_s[rows], found.separation_m[rows]))[0]]
        begin_s = first + second
        separation_m, at_s = float(found.separation_m[nearest]), begin_s + float(found.separation_at_s[nearest])
        yield NearEvent(begin_s + float(found.contact_s[rows].min()), begin_s + 1.0, separation_m, at_s)


def later(track: Forecasts, delay_s: float) -> Forecasts:
    """A track that is so much later."""
    return replace(track, t_s=track.t_s + delay_s)


def on_floor(track: Forecasts, base: int) -> Forecasts:
    """A track on other floors, by numbers from `base` on."""
    return replace(track, floor=np.where(track.floor < 0, -1, track.floor + base))
