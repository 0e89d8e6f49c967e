"""Forecasts kept until their moment has come, and what came of them by the robot's own next reports."""

from typing import NamedTuple

import numpy as np

from deconflict.foresight.forecast_errors import track_kernels
from deconflict.foresight.forecast_errors.candidate_pairs import nearing
from deconflict.foresight.forecast_errors.ledger import HORIZONS
from deconflict.foresight.forecast_errors.pose_sampling import poses_at
from deconflict.foresight.forecast_errors.quantile_sketch import LIMITS_M
from deconflict.foresight.forecast_errors.track_kernels import Errors, Robots
from deconflict.sweep.geometry.encounter import STANDING_MPS
from ingest.batch import Batch, Bools, Floats, Ints
from ingest.kernels import ready

KEPT = HORIZONS + 1
SPACED_S = 0.9
"""A forecast is kept only so long after the last one that was."""
JOINED_S = 2.1
"""ReportedTracks further apart say nothing of where the robot was between them."""
TRACK_S = HORIZONS + 2
"""How far ahead of a report its forecast is sampled: the horizon, and how old a report in use may be."""
TRACK_LOOKS: Floats = np.arange(TRACK_S + 1.0)
ROUNDING_M = 1e-6
LONG_AGO_S = -1e12
"""Before any report."""


class ReportedTracks(NamedTuple):
    """n robots of a batch, each of them once. Arrays are (n,)."""

    slot: Ints
    kind: Ints
    """Row of the ledger."""
    event_s: Floats
    doubt_m: Floats
    length_m: Floats
    width_m: Floats
    track: Floats
    """(n, TRACK_S + 1, 4) x_m, y_m, yaw_rad and floor as reported, and as forecast for each second from then on; nan
    where that is not told."""

    @classmethod
    def of(cls, batch: Batch, slots: Ints, kinds: Ints) -> "ReportedTracks":
        event_s, told = ready(batch.event_s), batch.forecasts
        sizes_m = ready(batch.doubt_m), ready(told.length_m), ready(told.width_m)
        return cls(slots, kinds, event_s, *sizes_m, poses_at(told, event_s, TRACK_LOOKS))


class RelativePoses(NamedTuple):
    """n pairs of robots, looked at k times in the past and m times ahead. Arrays are (n, k + m) but for two."""

    past_s: Floats
    """(n, k) when that was; nan where both have not reported since."""
    dx_m: Floats
    """From the first to the other, and so on."""
    dy_m: Floats
    yaw_a_rad: Floats
    yaw_b_rad: Floats
    same: Bools
    """Whether both are known to be on one floor."""
    speed_mps: Floats
    """(2, n) at which each goes on, by its forecast."""


class PendingForecasts:
    """By slot: the newest report, and the last `KEPT` forecasts."""

    def __init__(self) -> None:
        self.seen = np.zeros((0, 5))
        """(slots, 5) t_s, x_m, y_m, yaw_rad and floor of the newest report."""
        self._before = np.zeros((0, 5))
        self.track = np.zeros((0, TRACK_S + 1, 4))
        """(slots, TRACK_S + 1, 4) of the newest report: x_m, y_m, yaw_rad and floor, every second from then on."""
        self._around = np.zeros((0, 5))
        """(slots, 5) of a box that a robot will not leave, whenever `beside` is asked: x_m, y_m and half sides; and the
        furthest that it goes in a second."""
        self._made_s = np.zeros((0, KEPT))
        self._stopped = np.zeros((0, KEPT), np.bool_)
        """Whether the robot has stood where the forecast had it go."""
        self._next = np.zeros(0, np.int64)
        self._kind = np.zeros((0, KEPT), np.int64)
        self._ahead = np.zeros((0, KEPT, HORIZONS, 4))
        """x_m, y_m, yaw_rad and floor."""
        self._bands_m = np.zeros((0, KEPT, HORIZONS, 3))

    def grow(self, slots: int) -> None:
        more = slots - len(self._next)
        if more > 0:
            for name, column in vars(self).items():
                setattr(self, name, np.concatenate([column, np.zeros((more, *column.shape[1:]), column.dtype)]))
            self.forget(np.arange(slots - more, slots))

    def forget(self, slots: Ints) -> None:
        """Other robots have these slots from now on."""
        self._made_s[slots] = self.seen[slots, 0] = self._before[slots, 0] = LONG_AGO_S

    @property
    def heard_s(self) -> Floats:
        """(slots,) event time of the newest report."""
        return self.seen[:, 0]

    def beside(
        self, a: Ints, b: Ints, past_looks: Floats, ahead_s: Floats, now_s: float, late_s: Floats | None = None
    ) -> RelativePoses:
        """Robots `b` (n,) as seen from `a` (n,): since both reported before, at those parts (k,) of the time, and at
        `now_s + ahead_s` (m,), by their newest forecasts, which begin `late_s` (2, n) later if that is given."""
        reports = (self._before, self.seen, self.track)
        late_s = np.zeros((2, len(a))) if late_s is None else late_s
        return RelativePoses(
            *track_kernels.beside(*reports, a, b, past_looks, ahead_s, now_s, LONG_AGO_S, JOINED_S, late_s)
        )

    def nearing(self, told: Bools, slots: Ints, rank: Ints, reach_m: Floats, now_s: float, horizon_s: float) -> Ints:
        """(p, 2) pairs of `slots`, one of each `told`, that come within the `reach_m` of both in the horizon, looked at
        every whole second; the lower in `rank` first. `told`, `rank` and `reach_m` are by slot."""
        seconds, reports = int(horizon_s) + 1, (self._around, reach_m, self.seen, self.track)
        return nearing(told, slots, rank, *reports, now_s, seconds, ROUNDING_M)

    def speed_mps(self, slot: int) -> float:
        """At which a robot went from its last report but one to the last; nan where that is not known."""
        return track_kernels.speed_mps(self._before, self.seen, slot, JOINED_S)

    def disown(self, slots: Ints) -> None:
        """Hold none of the forecasts made so far to account."""
        self._made_s[slots] = LONG_AGO_S

    def add_reports(
        self, robots: Robots, half: Floats, reports: ReportedTracks, bands_m: Floats
    ) -> tuple[Errors, Bools]:
        """Keep the reports and their forecasts, and what they say of `robots`, by slot, and their `half` sides (2,
        slots); the errors that they show, and whether each of n stands. `bands_m` are (kinds, HORIZONS, 3)."""
        return track_kernels.take(
            robots,
            half,
            self._before,
            self.seen,
            self.track,
            self._around,
            self._made_s,
            self._stopped,
            self._next,
            self._kind,
            self._ahead,
            self._bands_m,
            *reports,
            bands_m,
            LIMITS_M,
            LONG_AGO_S,
            JOINED_S,
            SPACED_S,
            STANDING_MPS,
        )
