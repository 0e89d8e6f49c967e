"""Forecasts that are kept until their moments have come, and their errors by the robots' own next reports."""

from typing import NamedTuple

import numpy as np

from deconflict.foresight.forecast_errors import candidate_pairs, track_kernels
from deconflict.foresight.forecast_errors.error_ledger import HORIZONS
from deconflict.foresight.forecast_errors.track_kernels import LONG_AGO_S, Errors, ReportHistory, Robots
from deconflict.foresight.history_rows import HistoryRows, with_rows
from deconflict.sweep.geometry.pose import poses_at
from ingest.batch import Batch, Bools, Floats, Ints
from ingest.kernels import ready

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
        return candidate_pairs.find_pairs(
            has_news, is_left_out, waits, slots, rank, *reports, now_s, seconds, ROUNDING_M
        )

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
