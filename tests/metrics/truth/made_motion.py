"""Recorded motion made by hand, and what is true of it."""

from collections.abc import Callable, Sequence
from math import inf

import numpy as np

from ingest.batch import Forecasts
from metrics.truth.encounters import EncounterFinder


def zero(_: float) -> float:
    return 0.0


def reported(
    truth: EncounterFinder, t_s: float, *robots: tuple[str, int, float], bottom_m: Sequence[float] = ()
) -> None:
    """Robots of 1 x 1 x 1 m, each with its name, floor and x; on the ground unless their heights are given."""
    n = len(robots)
    forecasts = Forecasts(
        start=np.arange(n + 1),
        t_s=np.full(n, t_s),
        x_m=np.array([x_m for _, _, x_m in robots]),
        y_m=np.zeros(n),
        yaw_rad=np.zeros(n),
        floor=np.array([floor for _, floor, _ in robots]),
        length_m=np.ones(n),
        width_m=np.ones(n),
        bottom_m=np.array(bottom_m or [0.0] * n),
        top_m=np.array([inf if value == -inf else value + 1.0 for value in bottom_m or [0.0] * n]),
    )
    truth.report([name for name, _, _ in robots], forecasts)


def driven(
    *pieces: tuple[float, float, float],
    until_s: float,
    finished: bool = True,
    above_m: Callable[[float], float] = zero,
    drawn_apart_m: float = 0.1,
) -> EncounterFinder:
    """A 1 x 1 x 1 m robot at the origin, another at x, moving from (from_s, x) at a speed, piece after piece.

    `above_m` says by time how high the foot of the second is.
    """
    truth = EncounterFinder([0.3], drawn_apart_m)
    for second in range(int(until_s) + 1):
        t_s = float(second)
        from_s, x_m, speed_mps = max((piece for piece in pieces if piece[0] <= t_s), key=lambda piece: piece[0])
        reported(truth, t_s, ("a", 0, 0.0), ("b", 0, x_m + speed_mps * (t_s - from_s)), bottom_m=(0.0, above_m(t_s)))
        truth.advance(t_s)
    if finished:
        truth.finish()
    return truth
