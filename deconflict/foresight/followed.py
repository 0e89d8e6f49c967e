"""Forecasts kept until their moment has come, and what came of them by the robot's own next reports."""

from dataclasses import dataclass

import numpy as np

from deconflict.foresight.ledger import HORIZONS, Errors
from deconflict.foresight.sampling import Poses, poses_at
from ingest.seam import Batch, Floats, Ints

KEPT = HORIZONS + 1
SPACED_S = 0.9
"""A forecast is kept only so long after the last one that was."""
JOINED_S = 2.1
"""Reports further apart say nothing of where the robot was between them."""
TRACK_S = HORIZONS + 2
"""How far ahead of a report its forecast is sampled: the horizon, and how old a report in use may be."""
LONG_AGO_S = -1e12
"""Before any report."""
AHEAD: Floats = np.arange(1.0, HORIZONS + 1)


@dataclass(frozen=True, slots=True, eq=False)
class Reports:
    """n robots of a batch whose forecasts can be followed: each of them once."""

    slot: Ints
    kind: Ints
    """Row of the ledger."""
    event_s: Floats
    track: Poses
    """(n, TRACK_S + 1) as reported, and as forecast for each second from then on."""

    @classmethod
    def of(cls, batch: Batch, slots: Ints, kinds: Ints) -> "Reports":
        track = poses_at(batch.forecasts, batch.event_s[:, None] + np.arange(TRACK_S + 1.0))
        finite = np.flatnonzero(np.isfinite(track.columns()).all(axis=(1, 2)))
        return cls(slots[finite], kinds[finite], batch.event_s[finite], track.take(finite))


class Followed:
    """By slot: the newest report, and the last `KEPT` forecasts."""

    def __init__(self) -> None:
        self._seen = np.zeros((0, 5))
        """(slots, 5) t_s, x_m, y_m, yaw_rad and floor of the newest report."""
        self._before = np.zeros((0, 5))
        self._track = np.zeros((0, TRACK_S + 1, 4))
        """Of the newest report: x_m, y_m, yaw_rad and floor."""
        self._around = np.zeros((0, 4))
        """(slots, 4) of the circle around the track: x_m, y_m and radius; and its longest step."""
        self._made_s = np.zeros((0, KEPT))
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
        self._made_s[slots] = self._seen[slots, 0] = self._before[slots, 0] = LONG_AGO_S

    @property
    def heard_s(self) -> Floats:
        """(slots,) event time of the newest report."""
        return self._seen[:, 0]

    def between(self, slots: Ints, t_s: Floats) -> Poses:
        """Where robots were at `t_s` (n, m), joined linearly from the last two reports; floor -1 where not known."""
        return _joined(self._before[slots], self._seen[slots], t_s)

    def ahead(self, slots: Ints, t_s: Floats) -> Poses:
        """Where robots will be at `t_s` (n, m) by their newest forecasts, linear between its samples."""
        since_s = np.clip(t_s - self._seen[slots, :1], 0.0, float(TRACK_S))
        whole = np.minimum(since_s.astype(np.int64), TRACK_S - 1)
        before, after = self._track[slots[:, None], whole], self._track[slots[:, None], whole + 1]
        share = (since_s - whole) * (before[..., 3] == after[..., 3])
        turn = (after[..., 2] - before[..., 2] + np.pi) % (2 * np.pi) - np.pi
        x_m, y_m = (before[..., k] + share * (after[..., k] - before[..., k]) for k in (0, 1))
        return Poses(x_m, y_m, before[..., 2] + share * turn, before[..., 3].astype(np.int64))

    def around(self, slots: Ints) -> tuple[Floats, Floats, Floats]:
        """Centre (n, 2) and radius (n,) of a circle that robots will not leave, whenever `ahead` is asked, and the
        furthest that they go in a second (n,)."""
        around = self._around[slots]
        return around[:, :2], around[:, 2], around[:, 3]

    def last_two_s(self, slots: Ints) -> tuple[Floats, Floats]:
        """(n,) times of the last two reports, the earlier first: `LONG_AGO_S` where there is none shortly before."""
        before_s, seen_s = self._before[slots, 0], self._seen[slots, 0]
        return np.where(before_s >= seen_s - JOINED_S, before_s, LONG_AGO_S), seen_s

    def speed_mps(self, slots: Ints) -> Floats:
        """(n,) at which robots went from their last report but one to the last; nan where that is not known."""
        before, seen = self._before[slots], self._seen[slots]
        lasted_s = seen[:, 0] - before[:, 0]
        known = (lasted_s > 0) & (lasted_s <= JOINED_S) & (before[:, 4] == seen[:, 4])
        went_m = np.hypot(*(seen[:, k] - before[:, k] for k in (1, 2)))
        return np.where(known, went_m / np.where(known, lasted_s, 1.0), np.nan)

    def disown(self, slots: Ints) -> None:
        """Hold none of the forecasts made so far to account."""
        self._made_s[slots] = LONG_AGO_S

    def take(self, reports: Reports, bands_m: Floats) -> Errors:
        """The errors that the reports show, and the new forecasts kept; `bands_m` (n, HORIZONS, 3) are theirs."""
        newer = np.flatnonzero(reports.event_s > self._seen[reports.slot, 0])
        slots, track = reports.slot[newer], reports.track.columns()[newer]
        self._before[slots] = self._seen[slots]
        self._seen[slots, 0], self._seen[slots, 1:] = reports.event_s[newer], track[:, 0]
        self._track[slots] = track
        self._around[slots] = _around(track)
        errors = self._shown(slots)
        self._keep(reports, newer, bands_m)
        return errors

    def _shown(self, slots: Ints) -> Errors:
        """Errors of kept forecasts of moments between the last two reports."""
        before_s, seen_s = self.last_two_s(slots)
        due_s = self._made_s[slots][:, :, None] + AHEAD
        due = (due_s > before_s[:, None, None]) & (due_s <= seen_s[:, None, None])
        due &= (before_s > LONG_AGO_S)[:, None, None]
        n, kept, ahead = np.nonzero(due)
        slot = slots[n]
        was = self.between(slot, due_s[n, kept, ahead][:, None])
        x_m, y_m, yaw_rad, floor = self._ahead[slot, kept, ahead].T
        comparable = np.flatnonzero((floor == was.floor[:, 0]) & (floor >= 0))
        dx, dy = was.x_m[:, 0] - x_m, was.y_m[:, 0] - y_m
        c, s = np.cos(yaw_rad), np.sin(yaw_rad)
        every = Errors(
            self._kind[slot, kept], slot, ahead + 1, c * dx + s * dy, c * dy - s * dx, self._bands_m[slot, kept, ahead]
        )
        return every.take(comparable)

    def _keep(self, reports: Reports, newer: Ints, bands_m: Floats) -> None:
        last_s = self._made_s[reports.slot[newer]].max(axis=1)
        rows = newer[reports.event_s[newer] - last_s >= SPACED_S]
        slots = reports.slot[rows]
        place = self._next[slots]
        self._next[slots] = (place + 1) % KEPT
        self._made_s[slots, place], self._kind[slots, place] = reports.event_s[rows], reports.kind[rows]
        self._ahead[slots, place] = reports.track.columns()[rows, 1 : HORIZONS + 1]
        self._bands_m[slots, place] = bands_m[rows]


def _around(track: Floats) -> Floats:
    """The circle around the box of each track (n, m, 4), and its longest step, (n, 4)."""
    low, high = track[..., :2].min(axis=1), track[..., :2].max(axis=1)
    steps = np.hypot(np.diff(track[..., 0]), np.diff(track[..., 1]))
    return np.column_stack([(low + high) / 2, np.hypot(*(high - low).T) / 2, steps.max(axis=1)])


def _joined(before: Floats, after: Floats, t_s: Floats) -> Poses:
    """Poses at `t_s` (n, m) on the lines from `before` to `after`, (n, 5) each."""
    known = (before[:, 0] > LONG_AGO_S) & (before[:, 4] == after[:, 4]) & (after[:, 0] - before[:, 0] <= JOINED_S)
    before = np.where(known[:, None], before, after)
    span_s = np.maximum(after[:, 0] - before[:, 0], 1e-9)
    share = np.clip((t_s - before[:, :1]) / span_s[:, None], 0.0, 1.0)
    turn = (after[:, 3] - before[:, 3] + np.pi) % (2 * np.pi) - np.pi
    x_m, y_m = (before[:, k, None] + share * (after[:, k] - before[:, k])[:, None] for k in (1, 2))
    floor = np.broadcast_to(np.where(known, after[:, 4], -1.0)[:, None], t_s.shape).astype(np.int64)
    return Poses(x_m, y_m, before[:, 3, None] + share * turn[:, None], floor)
