"""Where trailers went between the last two reports of the robots that pull them, and where they will go."""

from collections.abc import Iterable
from math import hypot
from typing import NamedTuple

import numpy as np

from deconflict.foresight.forecast_errors.pending_forecasts import TRACK_LOOKS
from deconflict.foresight.forecast_errors.track_kernels import LONG_AGO_S, ReportHistory
from deconflict.sweep.geometry.knots import motion_faults
from deconflict.sweep.geometry.pose import poses_at
from deconflict.sweep.shapes.trailers import rows_of_trains, trailer_forecasts
from deconflict.sweep.shapes.trains import pairs_with_trailers
from ingest.batch import Batch, Bools, Floats, Forecasts, Ints


class TrainTracks(NamedTuple):
    """The trailers of one robot, k of them. Columns as in `ReportHistory`."""

    newest: Floats
    """(k, 5)"""
    previous: Floats
    """(k, 5)"""
    track: Floats
    """(k, seconds, 4)"""
    half_m: Floats
    """(2, k) half length and half width."""
    reach_m: float
    """Radius of the circle around the robot's centre that holds its trailers."""


class BodyPairs(NamedTuple):
    """All pairs of bodies of pairs of robots: k bodies, which are the robots and, after them, their trailers."""

    a: Ints
    """(n,) the first body of each pair; `b` is the second one."""
    b: Ints
    pair: Ints
    """(n,) the row of the pair of robots, ascending."""
    history: ReportHistory
    """`newest`, `previous` and `track` are of the k bodies."""
    slot: Ints
    """(k,) the slot of the robot, or of the one that pulls the trailer."""
    trailer_half_m: Floats
    """(2, trailers) half length and half width."""


class TrailerTracks:
    """The tracks of all trailers, by the slots of the robots that pull them."""

    def __init__(self) -> None:
        self._trains: dict[int, TrainTracks] = {}

    def add(self, batch: Batch, slots: Ints) -> None:
        """Add the reports of a batch. A robot that has no trailers any more has no tracks."""
        rows = rows_of_trains(batch.forecasts)
        if self._trains:
            self.forget(set(slots.tolist()).difference(slots[rows].tolist()))
        if not rows:
            return
        forecasts, event_s = batch.forecasts.take(rows), batch.event_s[rows]
        trailers, pulled_by = trailer_forecasts(forecasts, motion_faults(forecasts))
        tracks = poses_at(trailers, event_s[pulled_by], TRACK_LOOKS)
        half_m = np.stack([trailers.length_m, trailers.width_m]) / 2
        for row in np.unique(pulled_by).tolist():
            own = slice(*np.searchsorted(pulled_by, [row, row + 1]))
            self._report(int(slots[rows[row]]), float(event_s[row]), tracks[own], half_m[:, own], forecasts.single(row))

    def _report(self, slot: int, event_s: float, track: Floats, half_m: Floats, robot: Forecasts) -> None:
        before, newest = self._trains.get(slot), np.insert(track[:, 0], 0, event_s, axis=1)
        if before is not None and len(before.newest) == len(newest):
            if not event_s > before.newest[0, 0]:
                return
            previous = before.newest
        else:
            previous = np.full_like(newest, LONG_AGO_S)
        shape = robot.shape(0)
        reach_m = shape.reach_m(hypot(float(robot.length_m[0]), float(robot.width_m[0])) / 2) if shape else 0.0
        self._trains[slot] = TrainTracks(newest, previous, track, half_m, reach_m)

    def forget(self, slots: Iterable[int]) -> None:
        """These robots have no trailers."""
        for slot in slots:
            self._trains.pop(slot, None)

    def reaches_m(self) -> tuple[Ints, Floats]:
        """(t,) the slots of all trains, and `reach_m` of each."""
        slots = np.fromiter(self._trains, np.int64, len(self._trains))
        return slots, np.array([train.reach_m for train in self._trains.values()])

    def are_trains(self, slots: Ints) -> Bools:
        """Which of these robots pull trailers."""
        return np.fromiter(map(self._trains.__contains__, slots.tolist()), np.bool_, len(slots))

    def pairs_of_bodies(self, history: ReportHistory, a: Ints, b: Ints) -> BodyPairs:
        """All pairs of bodies of the robots `a` and `b` (p,), of which `history` has the reports by slot."""
        robots, rows = np.unique(np.concatenate([a, b]), return_inverse=True)
        trains = [(row, train) for row, slot in enumerate(robots.tolist()) if (train := self._trains.get(slot))]
        slots, trailers, first = [robots], dict[int, range](), len(robots)
        parts = [(history.newest[robots], history.previous[robots], history.track[robots])]
        for row, train in trains:
            trailers[row] = range(first, first + len(train.newest))
            slots.append(np.full(len(train.newest), robots[row]))
            parts.append(train[:3])
            first += len(train.newest)
        newest, previous, track = (np.concatenate(column) for column in zip(*parts, strict=True))
        each_a, each_b, pair = pairs_with_trailers(rows[: len(a)], rows[len(a) :], trailers)
        bodies = history._replace(newest=newest, previous=previous, track=track)
        half_m = np.concatenate([np.empty((2, 0)), *(train.half_m for _, train in trains)], axis=1)
        return BodyPairs(each_a, each_b, pair, bodies, np.concatenate(slots), half_m)
