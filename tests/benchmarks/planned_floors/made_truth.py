"""Small floors made by hand: robots of two vendors on straight lines, and what they reported."""

import numpy as np

from benchmarks.planned_floors.logs.reports import Report, Robot
from benchmarks.planned_floors.truth.floor_truth import Stop
from benchmarks.planned_floors.truth.motion import STEP_S, Motion
from ingest.batch import Floats

START_S = 1_790_000_000.0
A, B, C = "a", "b", "c"
VENDORS = {A: "Alder", B: "Birch", C: "Corvid"}


def motion_of(seconds: float, **places: tuple[float, float]) -> Motion:
    """Robots of 1 x 0.6 m that stand; `places` by robot."""
    samples = round(seconds / STEP_S) + 1
    x_m, y_m = (np.tile([place[k] for place in places.values()], (samples, 1)).astype(np.float64) for k in range(2))
    half_m = np.repeat([[0.5], [0.3]], len(places), axis=1)
    return Motion(START_S, tuple(places), x_m, y_m, np.zeros_like(x_m), half_m)


def line(motion: Motion, robot: str, from_m: float, to_m: float, begin_s: float, end_s: float) -> None:
    """Let a robot of `motion` drive along x between two times, counted from the start."""
    column, t_s = motion.robots.index(robot), np.arange(len(motion.x_m)) * STEP_S
    motion.x_m[:, column] = np.interp(t_s, [begin_s, end_s], [from_m, to_m])


def stop(
    start_s: float, robot: str = A, by: str = B, *, lasts_s: float = 5.0, v0_mps: float = 1.0, around_s: float = 0.0
) -> Stop:
    """A stop of so many seconds, after which the robot may drive around the other for `around_s`."""
    return Stop(
        robot=robot,
        by=by,
        start_s=START_S + start_s,
        end_s=START_S + start_s + lasts_s,
        v0_mps=v0_mps,
        standing_s=lasts_s - 1.0,
        same_vendor=VENDORS[robot] == VENDORS[by],
        around=around_s > 0,
        around_until_s=START_S + start_s + lasts_s + around_s,
        lost_s=lasts_s,
    )


def reporting(uuid: str, reports: list[Report]) -> Robot:
    return Robot(uuid, VENDORS[uuid], 1.0, 0.6, reports)


def report(
    t_s: float,
    x_m: float,
    y_m: float = 0.0,
    *,
    yaw_rad: float = 0.0,
    speed_mps: float = 0.0,
    to_x_m: float | None = None,
) -> Report:
    """A report, counted from the start; with `to_x_m` it tells a path that is there in 10 s."""
    at_s = START_S + t_s
    path: Floats = np.empty((0, 4))
    if to_x_m is not None:
        ahead_s = np.arange(1.0, 11.0)
        along_m = x_m + (to_x_m - x_m) * ahead_s / 10
        path = np.column_stack([at_s + ahead_s, along_m, np.full(10, y_m), np.full(10, yaw_rad)])
    return Report(at_s, at_s, x_m, y_m, yaw_rad, speed_mps, path)


def every_second(uuid: str, seconds: int, x_m: float = 0.0) -> Robot:
    """A robot that reports once a second from one place."""
    return reporting(uuid, [report(t_s, x_m) for t_s in range(seconds + 1)])
