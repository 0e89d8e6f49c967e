"""The courses of honest robots, whose meetings are known, and of crowds."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import atan2, cos, hypot, inf, pi, sin

import numpy as np

from tests.helpers.saying import points, status

Pose = tuple[float, float, float]
Course = Callable[[float], Pose]
"""x_m, y_m and yaw_rad at a time in seconds."""
HONEST_VENDORS = ("Alder", "Corvid")
CROWD_VENDOR = "Mallory"
PATH_S = 10
SPAN_M = 20.0
"""Length of the way that an honest robot drives to and fro."""
CROWD_M = 1.5
"""Radius of the disk on which a crowd drives criss-cross."""


@dataclass(frozen=True, slots=True)
class Robot:
    """A simulated robot."""

    name: str
    vendor: str
    course: Course
    sends_path: bool = True

    def status(self, start_s: float, t_s: float) -> bytes:
        """Its status `t_s` after the start."""
        x, y, yaw = self.course(t_s)
        path = [(start_s + t_s + k, *self.course(t_s + k)) for k in range(1, PATH_S + 1)]
        more = {"path": points(*path)} if self.sends_path else {}
        return status(self.name, start_s + t_s, x, y, yaw, **more)


def honest(pairs: int) -> list[Robot]:
    """Pairs of robots of two vendors that drive to and fro on two ways that cross."""
    return [
        Robot(f"honest {pair}.{side}", HONEST_VENDORS[side], _to_and_fro(pair, side))
        for pair in range(pairs)
        for side in (0, 1)
    ]


def period_s(pair: int) -> float:
    """How long a pair takes to and fro."""
    return 24.0 + 0.37 * pair


def meetings_s(pair: int, since_s: float, until_s: float) -> list[float]:
    """When the robots of a pair are nearest to each other. They meet twice in a period."""
    step_s = period_s(pair) / 2
    first = int(np.ceil((since_s / step_s) - 0.5))
    times_s = [(number + 0.5) * step_s for number in range(first, first + int((until_s - since_s) / step_s) + 2)]
    return [t_s for t_s in times_s if since_s <= t_s < until_s]


def _to_and_fro(pair: int, side: int) -> Course:
    middle_x, middle_y = 20.0 + 1.5 * SPAN_M * (pair % 5), 1.5 * SPAN_M * (pair // 5)

    def course(t_s: float) -> Pose:
        part = t_s / period_s(pair) % 1.0
        along_m = SPAN_M * (2 * part - 0.5 if part < 0.5 else 1.5 - 2 * part)
        yaw = 0.0 if part < 0.5 else pi
        return (middle_x + along_m, middle_y, yaw) if side == 0 else (middle_x, middle_y + along_m, yaw + pi / 2)

    return course


def crowd(robots: int, seed: int = 5) -> list[Robot]:
    """Robots of one vendor that drive criss-cross over one small disk."""
    rng = np.random.default_rng(seed)
    return [Robot(f"crowd {number}", CROWD_VENDOR, _chords(rng)) for number in range(robots)]


def at_origin(robots: int) -> list[Robot]:
    """Robots that report (0, 0): they do not know yet where they are."""
    return [Robot(f"lost {number}", CROWD_VENDOR, lambda _: (0.0, 0.0, 0.0), False) for number in range(robots)]


def _chords(rng: np.random.Generator, speed_mps: float = 1.0) -> Course:
    corners = [(CROWD_M * cos(turn), CROWD_M * sin(turn)) for turn in rng.uniform(-pi, pi, 200)]
    times_s = [0.0]
    for (x, y), (next_x, next_y) in pairwise(corners):
        times_s.append(times_s[-1] + max(hypot(next_x - x, next_y - y) / speed_mps, 0.1))
    xs, ys = zip(*corners, strict=True)

    def course(t_s: float) -> Pose:
        at = min(int(np.searchsorted([*times_s, inf], t_s, side="right")) - 1, len(times_s) - 2)
        x, y = float(np.interp(t_s, times_s, xs)), float(np.interp(t_s, times_s, ys))
        return x, y, atan2(ys[at + 1] - ys[at], xs[at + 1] - xs[at])

    return course
