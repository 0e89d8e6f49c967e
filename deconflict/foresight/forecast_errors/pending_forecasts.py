"""Forecasts that are kept until their moments have come, and their errors by the robots' own next reports.

The newest of them tell which pairs of robots may come near each other. `find_pairs`, which is compiled, is long because
it makes the grid of cells and then goes through it once: the size of a cell depends on all robots.
"""

from typing import NamedTuple

import numpy as np

from deconflict.foresight.forecast_errors import track_kernels
from deconflict.foresight.forecast_errors.error_ledger import HORIZONS
from deconflict.foresight.forecast_errors.track_kernels import LONG_AGO_S, Errors, ReportHistory, Robots, on_track
from deconflict.foresight.history_rows import HistoryRows, with_rows
from deconflict.sweep.geometry.pose import poses_at
from ingest.batch import Batch, Bools, Floats, Ints
from ingest.kernels import BOOLS, CUBE, FLOAT, FLOATS, INT, INT_MATRIX, INTS, MATRIX, inner, kernel, ready

MOST_FOUND = 256
"""A robot with news is paired with at most so many others. Far fewer bodies have room beside it."""


@inner
def _set_places(
    places: Floats, near: Floats, reach: Floats, newest: Floats, track: Floats, slot: int, now_s: float
) -> None:
    """Set the places of a robot at every whole second from now on, x_m, y_m and floor, in `places`; and its `reach`
    plus half of its longest step, in `near`. Does nothing if they are set already."""
    if near[slot] >= 0.0:
        return
    longest = 0.0
    for second in range(places.shape[1]):
        x, y, _, floor = on_track(track, slot, now_s - newest[slot, 0] + second)
        if second:
            dx, dy = x - places[slot, second - 1, 0], y - places[slot, second - 1, 1]
            longest = max(longest, dx * dx + dy * dy)
        places[slot, second, 0], places[slot, second, 1], places[slot, second, 2] = x, y, floor
    near[slot] = reach[slot] + np.sqrt(longest) / 2


@inner
def _are_near(x: float, y: float, floor: float, place: Floats, within: float) -> bool:
    """Whether a point and a place (3,) are on one floor, and within a distance of each other."""
    dx, dy = x - place[0], y - place[1]
    return bool(floor == place[2] and floor >= 0.0 and dx * dx + dy * dy <= within * within)


@inner
def _nearing(places: Floats, newest: Floats, a: int, b: int, within: float, waits: Bools) -> int:
    """The first of the seconds at which two robots are within a distance of each other, also if one that waits stays
    where it was reported, while the other goes; -1 if they never are."""
    stays, goes = (a, b) if waits[a] else (b, a)
    one_waits = waits[a] != waits[b]
    x, y, floor = newest[stays, 1], newest[stays, 2], newest[stays, 4]
    for second in range(places.shape[1]):
        if _are_near(places[a, second, 0], places[a, second, 1], places[a, second, 2], places[b, second], within):
            return second
        if one_waits and _are_near(x, y, floor, places[goes, second], within):
            return second
    return -1


@inner
def _cell(around: Floats, slot: int, side: float) -> tuple[int, int]:
    return int(np.floor(around[slot, 0] / side)), int(np.floor(around[slot, 1] / side))


@inner
def _cells(slots: Ints, around: Floats, side: float, across: int, after: Ints) -> Ints:
    """(across, across) the last of the slots whose boxes have their centre in each cell, -1 if there is none. The slot
    before it in the cell is in `after` (slots,), and so on to -1. Cells repeat in space, so that a far one costs no
    memory."""
    last = np.full((across, across), -1)
    for slot in slots:
        x, y = _cell(around, slot, side)
        x, y = x & (across - 1), y & (across - 1)
        after[slot], last[x, y] = last[x, y], slot
    return last


@kernel(INT_MATRIX(*[BOOLS] * 3, *[INTS] * 2, MATRIX, FLOATS, MATRIX, CUBE, FLOAT, INT, FLOAT))
def find_pairs(
    has_news: Bools,
    is_left_out: Bools,
    waits: Bools,
    slots: Ints,
    rank: Ints,
    around: Floats,
    reach: Floats,
    newest: Floats,
    track: Floats,
    now_s: float,
    seconds: int,
    rounding_m: float,
) -> Ints:
    """(p, 3) pairs of `slots` (n,) that come near each other at any of the whole seconds, and the first of these. Each
    pair comes once, the lower in `rank` first. At least one robot of each pair `has_news`, and none `is_left_out`. One
    that `waits` may stay where it was reported, while the other goes.

    Near means within the `reach` of both plus half of each one's longest step. Only robots whose boxes `around`, grown
    so, overlap are compared in time: they are in neighbouring cells.
    """
    box, found, pairs = np.empty((len(has_news), 2)), np.empty((64, 3), np.int64), 0
    widest, across = 0.0, 4
    for slot in slots:
        by = around[slot, 4] / 2 + reach[slot] + rounding_m
        box[slot, 0], box[slot, 1] = around[slot, 2] + by, around[slot, 3] + by
        widest = max(widest, box[slot, 0], box[slot, 1])
    while across * across < len(slots):
        across *= 2
    side, after = 2 * widest, np.empty(len(has_news), np.int64)
    last = _cells(slots, around, side, across, after)
    places, near = np.empty((len(has_news), seconds, 3)), np.full(len(has_news), -1.0)
    for slot in slots:
        if not has_news[slot] or is_left_out[slot]:
            continue
        most = pairs + MOST_FOUND
        _set_places(places, near, reach, newest, track, slot, now_s)
        x, y = _cell(around, slot, side)
        for cell in range(9):
            next_slot = last[(x + cell // 3 - 1) & (across - 1), (y + cell % 3 - 1) & (across - 1)]
            while next_slot >= 0 and pairs < most:
                beside, next_slot = next_slot, after[next_slot]
                away_x, away_y = abs(around[beside, 0] - around[slot, 0]), abs(around[beside, 1] - around[slot, 1])
                is_beyond = (away_x > box[slot, 0] + box[beside, 0]) | (away_y > box[slot, 1] + box[beside, 1])
                if is_beyond | is_left_out[beside] | (has_news[beside] & (beside <= slot)):
                    continue
                _set_places(places, near, reach, newest, track, beside, now_s)
                first = _nearing(places, newest, slot, beside, near[slot] + near[beside], waits)
                if first >= 0:
                    if pairs == len(found):
                        found = np.concatenate((found, np.empty_like(found)))
                    second = int(rank[slot] < rank[beside])
                    found[pairs, 1 - second], found[pairs, second], found[pairs, 2] = slot, beside, first
                    pairs += 1
    return found[:pairs].copy()


KEPT = HORIZONS + 1
"""Forecasts that are kept of each robot."""
TRACK_S = HORIZONS + 2
"""A forecast is sampled this far ahead of its report: the horizon, and the age of a report in use."""
TRACK_LOOKS: Floats = np.arange(TRACK_S + 1.0)
BY_SLOT = "newest", "previous", "track", "around"
OF_KEPT = "made_s", "stopped", "kind", "forecast", "bands_m"
BY_ROW = *OF_KEPT, "next_index"
"""Columns of the history by slot, and by the row of a robot that does not rest."""
ROUNDING_M = 1e-6


class ReportedTracks(NamedTuple):
    """n robots of a batch, each of them once. Arrays are (n,) unless stated otherwise."""

    slot: Ints
    kind: Ints
    """Row of the ledger."""
    event_s: Floats
    """Time of the newest pose."""
    doubt_m: Floats
    """Uncertainty of the reported position."""
    length_m: Floats
    """Of the envelope, along the heading."""
    width_m: Floats
    """Of the envelope, across the heading."""
    track: Floats
    """(n, TRACK_S + 1, 4) x_m, y_m, yaw_rad and floor: as reported, and as forecast for each second after that; nan if
    unknown."""

    @classmethod
    def of(cls, batch: Batch, slots: Ints, kinds: Ints) -> "ReportedTracks":
        """The robots of a batch, which have these slots and ledger rows."""
        event_s, forecasts = ready(batch.event_s), batch.forecasts
        sizes_m = ready(batch.doubt_m), ready(forecasts.length_m), ready(forecasts.width_m)
        return cls(slots, kinds, event_s, *sizes_m, poses_at(forecasts, event_s, TRACK_LOOKS))


class PendingForecasts:
    """By slot: the newest report, and of a robot that does not rest the last `KEPT` forecasts."""

    def __init__(self) -> None:
        of_robot, of_kept = np.zeros((0, 5)), np.zeros((0, KEPT))
        self._rows = HistoryRows()
        self.history = ReportHistory(
            newest=of_robot,
            previous=of_robot,
            track=np.zeros((0, TRACK_S + 1, 4)),
            around=of_robot,
            row=self._rows.of_slot,
            made_s=of_kept,
            stopped=of_kept.astype(np.bool_),
            next_index=np.zeros(0, np.int64),
            kind=of_kept.astype(np.int64),
            forecast=np.zeros((0, KEPT, HORIZONS, 4)),
            bands_m=np.zeros((0, KEPT, HORIZONS, 3)),
        )
        """Its columns are by slot or by row, see `BY_SLOT` and `BY_ROW`."""

    def grow(self, slots: int) -> None:
        """Make room for this many slots."""
        more = slots - len(self.newest)
        if more > 0:
            self._rows.grow(slots)
            longer = with_rows(self.history, BY_SLOT, slots)
            self.history = self.history._replace(row=self._rows.of_slot, **longer)
            self.forget(np.arange(slots - more, slots))

    def forget(self, slots: Ints) -> None:
        """Other robots have these slots from now on."""
        self.rest(slots)
        self.history.newest[slots, 0] = self.history.previous[slots, 0] = LONG_AGO_S

    def rest(self, slots: Ints) -> None:
        """These robots have been silent for so long that their kept forecasts are of no use."""
        if len(slots):
            self.history.made_s[self._rows.release(slots)] = LONG_AGO_S
            self._fit()

    def _fit(self) -> None:
        rows, before = len(self._rows), len(self.history.made_s)
        if rows != before:
            self.history = self.history._replace(**with_rows(self.history, BY_ROW, rows))
            self.history.made_s[before:] = LONG_AGO_S

    @property
    def newest(self) -> Floats:
        """(slots, 5) t_s, x_m, y_m, yaw_rad and floor of the newest report."""
        return self.history.newest

    def candidate_pairs(
        self,
        has_news: Bools,
        is_left_out: Bools,
        waits: Bools,
        slots: Ints,
        rank: Ints,
        reach_m: Floats,
        now_s: float,
        horizon_s: float,
    ) -> Ints:
        """(p, 3) pairs of `slots` that come within the `reach_m` of both at any whole second of the horizon, and the
        first of these seconds. At least one robot of each pair `has_news`, and none `is_left_out`; one that `waits` may
        stay where it was reported, while the other goes. The lower in `rank` comes first. These arrays are by slot."""
        seconds, reports = int(horizon_s) + 1, (self.history.around, reach_m, self.newest, self.history.track)
        slots = slots[(self.newest[slots, 4] >= 0.0) | (self.history.track[slots, :, 3] >= 0.0).any(axis=1)]
        return find_pairs(has_news, is_left_out, waits, slots, rank, *reports, now_s, seconds, ROUNDING_M)

    def turn(self, next_index: Ints) -> None:
        """Have the next forecast of each row (rows,) come at this place, after the same ones as before."""
        shift = (next_index - self.history.next_index) % KEPT
        of = (np.arange(KEPT) - shift[:, None]) % KEPT
        for name in OF_KEPT:
            column = getattr(self.history, name)
            column[:] = column[np.arange(len(column))[:, None], of]
        self.history.next_index[:] = next_index % KEPT

    def drop_forecasts(self, slots: Ints) -> None:
        """Do not compare the forecasts that these robots made until now with later reports."""
        rows = self._rows.of_slot[slots]
        self.history.made_s[rows[rows >= 0]] = LONG_AGO_S

    def add_reports(
        self, robots: Robots, half_m: Floats, reports: ReportedTracks, bands_m: Floats
    ) -> tuple[Errors, Bools]:
        """Keep n reports and their forecasts, and update `robots` (slots,) and their half sides `half_m` (2, slots).

        Returns the errors of earlier forecasts, and (n,) whether each robot stands. `bands_m` (kinds, HORIZONS, 3) are
        the bands of the ledger.
        """
        self._rows.assign(reports.slot)
        self._fit()
        return track_kernels.add_reports(robots, half_m, self.history, *reports, bands_m)
