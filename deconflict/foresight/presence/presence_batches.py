"""Batches about robots that have not reported: what is believed of them has changed."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from deconflict.foresight.presence.lasting_silences import PresenceChanges
from deconflict.foresight.presence.live_robots import LiveRobots
from ingest.batch import Basis, Batch, Forecasts

LATER_S = 1e-6
"""What is believed of a robot replaces what it told only where it is newer."""
NOBODY = np.empty(0, np.int64)


def contention_batches(live: LiveRobots, changes: PresenceChanges, now_s: float) -> Iterator[Batch]:
    """What contention is told of: who has probably left wants nothing, and holds up nobody."""
    if changes.left:
        yield removal_batch(live, changes.left, now_s)
    if changes.back:
        yield last_reports(live, changes.back, now_s)


def last_reports(live: LiveRobots, robots: Sequence[str], now_s: float) -> Batch:
    """Robots on the floor as they were told of last."""
    rows = [(one.batch, one.row) for one in map(live.robots.__getitem__, robots)]
    parts = [replace(batch.take(np.array([row]), ()), floors=live.floors) for batch, row in rows]
    batch = Batch.joined(parts)
    return replace(batch, now_s=now_s, statuses=np.zeros(len(batch), np.int64), claims=())


def stopped_batch(live: LiveRobots, robots: Sequence[str], now_s: float) -> Batch:
    """Robots on the floor, as standing where they were when they were heard last."""
    batch = last_reports(live, robots, now_s)
    told, first, n = batch.forecasts, batch.forecasts.start[:-1], len(batch)
    forecasts = Forecasts(
        np.arange(n + 1),
        *(told.t_s[first], told.x_m[first], told.y_m[first], told.yaw_rad[first], told.floor[first]),
        *(told.length_m, told.width_m, told.bottom_m, told.top_m),
    )
    basis = np.full(n, Basis.STATIONARY.value)
    return replace(batch, forecasts=forecasts, basis=basis, event_s=batch.event_s + LATER_S)


def removal_batch(live: LiveRobots, robots: Sequence[str], now_s: float) -> Batch:
    """Nobody, and that these robots of the floor are gone."""
    batch = live.robots[robots[0]].batch.take(NOBODY, tuple(robots))
    return replace(batch, floors=live.floors, now_s=now_s, claims=())
