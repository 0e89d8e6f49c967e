"""Robots that report once a second with their paths, as reports for `InteractionFinder`."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from deconflict.foresight.interactions.interaction_finder import Interaction, InteractionFinder
from deconflict.foresight.interactions.progress_kernels import AHEAD_S
from deconflict.foresight.interactions.recent_reports import InteractionReports
from ingest.batch import Floats

NOW_S = 1_790_000_000.0
HALF_M = np.array([0.5, 0.3])
NO_REST: Mapping[int, float] = MappingProxyType({})

Place = Callable[[float], tuple[float, float, float]]
"""x_m, y_m and yaw_rad of a robot so many seconds after the start, or of its plan."""


class Robot:
    """The motion of a robot, and its plan at each moment: `plan(t_s)` is its place from then on."""

    def __init__(self, does: Place, plan: Callable[[float], Place] | None = None, vendor: int = 0) -> None:
        self.does, self.plan, self.vendor = does, plan or (lambda _: does), vendor

    def track(self, t_s: float) -> Floats:
        ahead = [(*self.plan(t_s)(t_s + after_s), 0.0) for after_s in range(1, AHEAD_S + 1)]
        return np.array([(*self.does(t_s), 0.0), *ahead])


def found(
    robots: Sequence[Robot],
    until_s: float,
    every_s: float = 1.0,
    levels_m: Floats | None = None,
    explained: Sequence[int] = (),
    usual_m: float = 0.0,
    rests_s: Mapping[int, float] = NO_REST,
) -> list[Interaction]:
    """The interactions that reports of these robots show. Robots rest from `rests_s` on, and report no more."""
    finder, n, interactions = InteractionFinder(), len(robots), list[Interaction]()
    finder.grow(n)
    half_m, vendor = np.tile(HALF_M[:, None], (1, n)), np.array([robot.vendor for robot in robots])
    levels_m = np.tile(np.array([[0.0], [1.0]]), (1, n)) if levels_m is None else levels_m
    for t_s in np.arange(0.0, until_s, every_s).tolist():
        interactions += finder.rest(np.array([slot for slot, at_s in rests_s.items() if at_s <= t_s], np.int64))
        slots = np.array([slot for slot in range(n) if rests_s.get(slot, np.inf) > t_s])
        tracks = np.array([robots[slot].track(t_s) for slot in slots])
        says_why = np.isin(slots, explained)
        usual = np.full((len(slots), AHEAD_S), usual_m)
        reports = InteractionReports(slots, np.full(len(slots), NOW_S + t_s), tracks, says_why, usual)
        interactions += finder.receive(reports, half_m, levels_m, vendor)
    return interactions


def drives(start_m: float, speed_mps: float, y_m: float = 0.0) -> Place:
    """Drives along x at a constant speed."""
    yaw_rad = 0.0 if speed_mps >= 0 else np.pi
    return lambda t_s: (start_m + speed_mps * t_s, y_m, yaw_rad)


def stops(start_m: float, speed_mps: float, at_s: float, until_s: float = np.inf, y_m: float = 0.0) -> Place:
    """As `drives`, with a sudden stop from `at_s` to `until_s`."""
    yaw_rad = 0.0 if speed_mps >= 0 else np.pi

    def place(t_s: float) -> tuple[float, float, float]:
        moving_s = min(t_s, at_s) + max(t_s - until_s, 0.0)
        return start_m + speed_mps * moving_s, y_m, yaw_rad

    return place


def goes_on(does: Place, speed_mps: float) -> Callable[[float], Place]:
    """The plan of a robot that always expects to go on straight from its place."""

    def plan(made_s: float) -> Place:
        x_m, y_m, yaw_rad = does(made_s)
        return lambda t_s: (x_m + speed_mps * (t_s - made_s), y_m, yaw_rad)

    return plan


def blind(does: Place, speed_mps: float, vendor: int = 0) -> Robot:
    """A robot whose plan does not foresee what stops it."""
    return Robot(does, goes_on(does, speed_mps), vendor)
