"""Robots that report once a second, and the losses that the finder finds in their reports."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from deconflict.foresight.interactions.progress_kernels import AHEAD_S
from deconflict.foresight.losses.loss import Loss
from deconflict.foresight.losses.loss_finder import LossFinder
from ingest.batch import AMOUNTS, Basis, Batch, Destinations, Floats, Forecasts
from tests.helpers.made_encounters import NOW_S

HALF_M = (0.5, 0.3)


@dataclass
class Robot:
    """Drives along x, or along y if `heads_up`, at `speed_mps`, but stands from `stops_s` to `until_s`. Its plan is to
    drive on at once."""

    start: tuple[float, float]
    speed_mps: float
    stops_s: float = inf
    until_s: float = inf
    heads_up: bool = False
    state: str = "navigating"
    vendor: str = "Alder"
    basis: Basis = Basis.PATH
    withdraws_path: bool = False
    """While it stands, it reports no path."""
    turn_radps: float = 0.0
    """Turn rate while it stands."""
    is_crowded: bool = False

    def stands(self, t_s: float) -> bool:
        return self.stops_s < t_s < self.until_s

    def track(self, t_s: float) -> Floats:
        """(AHEAD_S + 1, 4) x_m, y_m, yaw_rad and floor: where it is, and where it plans to be."""
        stood_s = max(min(t_s, self.until_s) - self.stops_s, 0.0)
        gone_m = self.speed_mps * (t_s - stood_s + np.arange(AHEAD_S + 1.0))
        x_m, y_m = self.start
        yaw = np.full(AHEAD_S + 1, np.pi / 2 if self.heads_up else 0.0)
        if self.stands(t_s):
            yaw += self.turn_radps * (t_s - self.until_s)
            if self.withdraws_path:
                gone_m = np.full(AHEAD_S + 1, gone_m[0])
        along = (
            (np.full(AHEAD_S + 1, x_m), y_m + gone_m) if self.heads_up else (x_m + gone_m, np.full(AHEAD_S + 1, y_m))
        )
        return np.column_stack([*along, yaw, np.zeros(AHEAD_S + 1)])


def losses(robots: Sequence[Robot], until_s: int) -> list[Loss]:
    """The losses in the reports of robots until then. Their UUIDs are their numbers."""
    finder, n, found = LossFinder(), len(robots), list[Loss]()
    finder.grow(n)
    half_m = np.tile(np.array(HALF_M)[:, None], (1, n))
    levels_m = np.tile(np.array([[0.0], [1.0]]), (1, n))
    numbers = {vendor: number for number, vendor in enumerate(dict.fromkeys(robot.vendor for robot in robots))}
    vendor = np.array([numbers[robot.vendor] for robot in robots])
    is_crowded = np.array([robot.is_crowded for robot in robots])
    for t_s in range(until_s):
        track = np.array([robot.track(float(t_s)) for robot in robots])
        usual_m = np.zeros((n, AHEAD_S))
        finder.receive(_batch(robots, float(t_s)), np.arange(n), track, usual_m, half_m, levels_m, vendor, is_crowded)
        found += finder.take()
    finder.forget(np.arange(n))
    return found + finder.take()


def _batch(robots: Sequence[Robot], t_s: float) -> Batch:
    n, nothing, now_s = len(robots), np.empty(0), NOW_S + t_s
    bases = [Basis.STATIONARY if robot.withdraws_path and robot.stands(t_s) else robot.basis for robot in robots]
    return Batch(
        now_s=now_s,
        floors=("hall",),
        robots=tuple(map(str, range(n))),
        vendors=tuple(robot.vendor for robot in robots),
        models=("",) * n,
        names=("",) * n,
        states=tuple(robot.state for robot in robots),
        statuses=np.ones(n, np.int64),
        first_arrival_s=np.full(n, now_s),
        arrival_s=np.full(n, now_s),
        event_s=np.full(n, now_s),
        basis=np.array([int(basis) for basis in bases]),
        doubt_m=np.zeros(n),
        reports_within_s=np.zeros(n),
        amounts=np.full(n, np.nan, AMOUNTS),
        forecasts=Forecasts.empty(),
        destinations=Destinations(np.zeros(n + 1, np.int64), nothing, nothing, nothing, np.empty(0, np.int64)),
        gone=(),
    )
