"""Forecasts that are kept until their moments have come, and their errors by the robots' own next reports."""

from typing import NamedTuple

import numpy as np

from deconflict.foresight.forecast_errors import candidate_pairs, track_kernels
from deconflict.foresight.forecast_errors.error_ledger import HORIZONS
from deconflict.foresight.forecast_errors.pose_sampling import poses_at
from deconflict.foresight.forecast_errors.quantile_sketch import LIMITS_M
from deconflict.foresight.forecast_errors.track_kernels import Errors, Robots
from deconflict.sweep.geometry.encounter import STANDING_MPS
from deconflict.sweep.geometry.rectangles import signed_gap
from ingest.batch import Batch, Bools, Floats, Ints
from ingest.kernels import ready

KEPT = HORIZONS + 1
"""Forecasts that are kept of each robot."""
SPACED_S = 0.9
"""Minimum time between two kept forecasts of a robot."""
JOINED_S = 2.1
"""Reports further apart do not tell where the robot was between them."""
TRACK_S = HORIZONS + 2
"""A forecast is sampled so far ahead of its report: the horizon, and the age of a report in use."""
TRACK_LOOKS: Floats = np.arange(TRACK_S + 1.0)
ROUNDING_M = 1e-6
LONG_AGO_S = -1e12
"""Before any report."""


class ReportedTracks(NamedTuple):
    """n robots of a batch, each of them once. Arrays are (n,) if not said otherwise."""

    slot: Ints
    kind: Ints
    """Row of the ledger."""
    event_s: Floats
    doubt_m: Floats
    length_m: Floats
    width_m: Floats
    track: Floats
    """(n, TRACK_S + 1, 4) x_m, y_m, yaw_rad and floor: as reported, and as forecast for each second after that; nan if
    unknown."""

    @classmethod
    def of(cls, batch: Batch, slots: Ints, kinds: Ints) -> "ReportedTracks":
        """The robots of a batch, which have these slots and ledger rows."""
        event_s, forecasts = ready(batch.event_s), batch.forecasts
        sizes_m = ready(batch.doubt_m), ready(forecasts.length_m), ready(forecasts.width_m)
        return cls(slots, kinds, event_s, *sizes_m, poses_at(forecasts, event_s, TRACK_LOOKS))


class RelativePoses(NamedTuple):
    """n pairs of robots, at k moments of the past and m moments ahead. Arrays are (n, k + m) if not said otherwise."""

    past_s: Floats
    """(n, k) the moments of the past; nan if the two have no time in common."""
    dx_m: Floats
    """From the first robot of the pair to the second."""
    dy_m: Floats
    yaw_a_rad: Floats
    yaw_b_rad: Floats
    is_same_floor: Bools
    """Whether both are known to be on one floor."""
    speed_mps: Floats
    """(2, n) speed of each robot now, by its forecast."""

    def separations_m(self, half_a_m: Floats, half_b_m: Floats) -> Floats:
        """(n, k + m) distance of the two envelopes, negative if they overlap. `half_a_m` and `half_b_m` (2, n) are
        their half sides."""
        return signed_gap(self.dx_m, self.dy_m, self.yaw_a_rad, self.yaw_b_rad, half_a_m, half_b_m)


class PendingForecasts:
    """By slot: the newest report, and the last `KEPT` forecasts."""

    def __init__(self) -> None:
        self.newest = np.zeros((0, 5))
        """(slots, 5) t_s, x_m, y_m, yaw_rad and floor of the newest report."""
        self._previous = np.zeros((0, 5))
        """(slots, 5) the same of the report before it."""
        self.track = np.zeros((0, TRACK_S + 1, 4))
        """(slots, TRACK_S + 1, 4) x_m, y_m, yaw_rad and floor of the newest report, and of every second after it."""
        self._around = np.zeros((0, 5))
        """(slots, 5) a box around the track: x_m and y_m of its centre, its half sides, and the longest distance that
        the robot goes in a second."""
        self._made_s = np.zeros((0, KEPT))
        """(slots, KEPT) when each kept forecast was made."""
        self._stopped = np.zeros((0, KEPT), np.bool_)
        """(slots, KEPT) whether the robot has stood at a time when this forecast had it move."""
        self._next = np.zeros(0, np.int64)
        """(slots,) the place of the next forecast among the kept ones."""
        self._kind = np.zeros((0, KEPT), np.int64)
        """(slots, KEPT) the ledger row of each kept forecast."""
        self._ahead = np.zeros((0, KEPT, HORIZONS, 4))
        """(slots, KEPT, HORIZONS, 4) x_m, y_m, yaw_rad and floor that were forecast."""
        self._bands_m = np.zeros((0, KEPT, HORIZONS, 3))
        """(slots, KEPT, HORIZONS, 3) radii of the bands when the forecast was made."""

    def grow(self, slots: int) -> None:
        """Make room for so many slots."""
        more = slots - len(self._next)
        if more > 0:
            for name, column in vars(self).items():
                setattr(self, name, np.concatenate([column, np.zeros((more, *column.shape[1:]), column.dtype)]))
            self.forget(np.arange(slots - more, slots))

    def forget(self, slots: Ints) -> None:
        """Other robots have these slots from now on."""
        self._made_s[slots] = self.newest[slots, 0] = self._previous[slots, 0] = LONG_AGO_S

    @property
    def heard_s(self) -> Floats:
        """(slots,) event time of the newest report."""
        return self.newest[:, 0]

    def relative_poses(
        self, a: Ints, b: Ints, past_looks: Floats, ahead_s: Floats, now_s: float, late_s: Floats | None = None
    ) -> RelativePoses:
        """The robots `b` (n,) as seen from `a` (n,): at these parts (k,) of the time since both reported before, and at
        `now_s + ahead_s` (m,) by their newest forecasts. The forecasts begin `late_s` (2, n) later, if that is
        given."""
        reports = (self._previous, self.newest, self.track)
        late_s = np.zeros((2, len(a))) if late_s is None else late_s
        looks = (past_looks, ahead_s, now_s)
        return RelativePoses(*track_kernels.relative_poses(*reports, a, b, *looks, LONG_AGO_S, JOINED_S, late_s))

    def candidate_pairs(
        self, has_news: Bools, slots: Ints, rank: Ints, reach_m: Floats, now_s: float, horizon_s: float
    ) -> Ints:
        """(p, 2) pairs of `slots` that come within the `reach_m` of both at any whole second of the horizon. At least
        one robot of each pair `has_news`; the lower in `rank` comes first. These three arrays are by slot."""
        seconds, reports = int(horizon_s) + 1, (self._around, reach_m, self.newest, self.track)
        return candidate_pairs.find_pairs(has_news, slots, rank, *reports, now_s, seconds, ROUNDING_M)

    def speed_mps(self, slot: int) -> float:
        """Speed of a robot between its last two reports; nan if unknown."""
        return track_kernels.speed_mps(self._previous, self.newest, slot, JOINED_S)

    def drop_forecasts(self, slots: Ints) -> None:
        """Do not compare the forecasts that these robots made until now with later reports."""
        self._made_s[slots] = LONG_AGO_S

    def add_reports(
        self, robots: Robots, half_m: Floats, reports: ReportedTracks, bands_m: Floats
    ) -> tuple[Errors, Bools]:
        """Keep n reports and their forecasts, and update `robots` (slots,) and their half sides `half_m` (2, slots).

        Returns the errors of earlier forecasts, and (n,) whether each robot stands. `bands_m` (kinds, HORIZONS, 3) are
        the bands of the ledger.
        """
        return track_kernels.add_reports(
            robots,
            half_m,
            self._previous,
            self.newest,
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
