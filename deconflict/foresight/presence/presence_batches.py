"""Batches about robots that have not reported, made when what is believed of them changes."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from deconflict.foresight.presence.live_robots import LiveRobots
from deconflict.foresight.presence.probably_left import PresenceChanges
from ingest.batch import Basis, Batch

LATER_S = 1e-6
"""Added to event times: a batch replaces an earlier one of a robot only if it is newer."""
NOBODY = np.empty(0, np.int64)


def contention_batches(live: LiveRobots, changes: PresenceChanges, now_s: float) -> Iterator[Batch]:
    """Batches for contention: a robot that has probably left needs no resource and blocks no other robot."""
    if changes.left:
        yield removal_batch(live, changes.left, now_s)
    if changes.back:
        yield last_reports(live, changes.back, now_s)


def last_reports(live: LiveRobots, robots: Sequence[str], now_s: float) -> Batch:
    """Robots on the floor as of their last reports."""
    rows = [(robot.batch, robot.row) for robot in map(live.robots.__getitem__, robots)]
    parts = [replace(batch.take(np.array([row]), ()), floors=live.floors) for batch, row in rows]
    batch = Batch.joined(parts)
    return replace(batch, now_s=now_s, statuses=np.zeros(len(batch), np.int64), claims=())


def stopped_batch(live: LiveRobots, robots: Sequence[str], now_s: float) -> Batch:
    """Robots on the floor, standing where they were last heard."""
    batch = last_reports(live, robots, now_s)
    f, first, n = batch.forecasts, batch.forecasts.start[:-1], len(batch)
    columns = {name: getattr(f, name)[first] for name in ("t_s", "x_m", "y_m", "yaw_rad", "floor")}
    forecasts = replace(f, start=np.arange(n + 1), **columns)
    basis = np.full(n, Basis.STATIONARY.value)
    return replace(batch, forecasts=forecasts, basis=basis, event_s=batch.event_s + LATER_S)


def removal_batch(live: LiveRobots, robots: Sequence[str], now_s: float) -> Batch:
    """A batch without robots, which says that these robots of the floor are gone."""
    batch = live.robots[robots[0]].batch.take(NOBODY, tuple(robots))
    return replace(batch, floors=live.floors, now_s=now_s, claims=())


def with_end_before(batch: Batch) -> Iterator[Batch]:
    """The batch; and before it one that ends what was known of the robots that began anew, if any did."""
    if batch.began_anew:
        yield batch.take(NOBODY, batch.began_anew)
    yield batch
