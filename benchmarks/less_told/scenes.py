"""Drawn scenes: two robots of two vendors whose ways cross or pass, with their true motion."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import cos, pi, sin
from uuid import NAMESPACE_URL, uuid5

import numpy as np

from benchmarks.less_told.drives import Drive, Style, driven
from benchmarks.planned_floors.truth.motion import STEP_S, Motion
from ingest.batch import Floats

VENDORS = ("Alder Robotics", "Birch Robotics")
SECONDS = 60.0
APART_M = 120.0
"""Distance from one scene to the next."""
COLUMNS = 10
NODE_M = 4.0
"""Distance from one node of a way to the next, at most."""
LONG_M = 1.8
SLOW = 0.85
"""A robot is slow below this share of its limit."""
MOST_HURRY = 1.5
KINDS = ("crossing", "corner", "head-on", "following", "turning", "stopping", "setting out")
Rng = np.random.Generator
Point = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Robot:
    """One robot of a scene."""

    name: str
    vendor: str
    length_m: float
    width_m: float
    phase_s: float
    """When within a second it reports."""
    is_hurried: bool
    """Whether its vendor plans its path faster than it drives, at most at the limit."""
    drive: Drive

    @cached_property
    def uuid(self) -> str:
        """In languages that name robots by UUID."""
        return str(uuid5(NAMESPACE_URL, f"less_told/{self.name}"))

    @property
    def model(self) -> str:
        return f"{self.length_m:g}x{self.width_m:g}"

    @property
    def is_slow(self) -> bool:
        return self.drive.style.pace_mps < SLOW * self.drive.style.limit_mps

    @property
    def hurry(self) -> float:
        """How much faster its path is than it."""
        style = self.drive.style
        return min(style.limit_mps / style.pace_mps, MOST_HURRY) if self.is_hurried else 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Two robots, away from all others."""

    seed: int
    kind: str
    robots: tuple[Robot, Robot]

    @property
    def classes(self) -> tuple[str, ...]:
        """What cases are grouped by."""
        traits = {
            "a slow robot": any(robot.is_slow for robot in self.robots),
            "robots at their limit": not any(robot.is_slow for robot in self.robots),
            "a long robot": any(robot.length_m >= LONG_M for robot in self.robots),
            "a path that is too fast": any(robot.is_hurried and robot.is_slow for robot in self.robots),
        }
        return (self.kind, *(name for name, holds in traits.items() if holds))


def drawn_scene(seed: int) -> Scene:
    """The scene of a seed. The kinds take turns."""
    rng, kind = np.random.default_rng([seed, 44]), KINDS[seed % len(KINDS)]
    at_m = np.array([seed % COLUMNS, seed // COLUMNS % COLUMNS], np.float64) * APART_M
    sizes = [_size(rng, long=kind == "turning" and side == 0) for side in range(2)]
    drives = _WAYS[kind](rng, [_style(rng), _style(rng)], sizes)
    turn_rad = float(rng.uniform(-pi, pi))
    robots = [
        Robot(
            f"{seed:04}{'ab'[side]}",
            VENDORS[side],
            *sizes[side],
            float(rng.uniform(0.0, 1.0)),
            bool(rng.random() < 0.2),
            _placed(drives[side], at_m, turn_rad),
        )
        for side in range(2)
    ]
    return Scene(seed, kind, (robots[0], robots[1]))


def motion_of(robots: list[Robot], uuids: list[str], start_s: float) -> Motion:
    """The true motion of robots that are known as `uuids`."""
    x_m, y_m, yaw_rad = np.stack([robot.drive.poses for robot in robots], axis=-1).transpose(1, 0, 2)
    half_m = np.array([[robot.length_m / 2 for robot in robots], [robot.width_m / 2 for robot in robots]])
    return Motion(start_s, tuple(uuids), x_m, y_m, yaw_rad, half_m)


def _style(rng: Rng) -> Style:
    limit_mps = float(rng.uniform(0.8, 2.0))
    share = 1.0 if rng.random() < 0.4 else float(rng.uniform(0.3, 0.8))
    return Style(limit_mps, share * limit_mps, float(rng.uniform(0.5, 1.0)), float(rng.uniform(0.5, 1.2)))


def _size(rng: Rng, *, long: bool) -> tuple[float, float]:
    is_long = long or rng.random() < 0.25
    length_m = float(rng.uniform(2.0, 4.0) if is_long else rng.uniform(0.6, 1.4))
    return round(length_m, 2), round(min(length_m, float(rng.uniform(0.5, 0.9))), 2)


def _nodes(*corners_m: Point) -> list[Point]:
    """The corners, with nodes between them."""
    nodes = [corners_m[0]]
    for (ax, ay), (bx, by) in pairwise(corners_m):
        count = max(round(float(np.hypot(bx - ax, by - ay)) / NODE_M), 1)
        nodes += [(ax + (bx - ax) * part / count, ay + (by - ay) * part / count) for part in range(1, count + 1)]
    return nodes


def _through(style: Style, angle_rad: float, before_s: float, after_s: float, aside_m: float = 0.0) -> Drive:
    """Straight on, past the middle of the scene `aside_m` to its left, from so long before to so long after."""
    ahead, left = (cos(angle_rad), sin(angle_rad)), (-sin(angle_rad), cos(angle_rad))
    points = [
        (along_m * ahead[0] + aside_m * left[0], along_m * ahead[1] + aside_m * left[1])
        for along_m in (-before_s * style.pace_mps, after_s * style.pace_mps)
    ]
    return driven(_nodes(*points), style, 0.0, SECONDS)


def _meeting(drives: tuple[Drive, Drive], meets_s: tuple[float, float]) -> list[Drive]:
    """Both shifted so that each is at its place of meeting, `meets_s` from its start, at the same time."""
    begin_s = [max(meets_s) - each_s for each_s in meets_s]
    return [drive.shifted(2.0 + by_s) for drive, by_s in zip(drives, begin_s, strict=True)]


def _middle_s(drive: Drive) -> float:
    """When a drive is nearest to the middle of the scene."""
    away_m = np.hypot(drive.poses[:, 0], drive.poses[:, 1])
    return float(np.argmin(away_m)) * STEP_S


def _lead(rng: Rng) -> tuple[float, float]:
    return float(rng.uniform(9.0, 18.0)), float(rng.uniform(3.0, 8.0))


def _crossing(rng: Rng, styles: list[Style], _: object) -> list[Drive]:
    first = _through(styles[0], 0.0, *_lead(rng))
    second = _through(styles[1], float(rng.uniform(0.8, 2.4)), *_lead(rng))
    return _meeting((first, second), (_middle_s(first), _middle_s(second) + float(rng.uniform(-7.0, 7.0))))


def _corner(rng: Rng, styles: list[Style], _: object) -> list[Drive]:
    before_s, after_s = _lead(rng)
    pace_mps, leg_m = styles[0].pace_mps, float(rng.uniform(2.0, 6.0))
    start_m, end_m = -max(before_s * pace_mps - leg_m, 1.0), after_s * pace_mps
    first = driven(_nodes((-leg_m, start_m), (-leg_m, 0.0), (end_m, 0.0)), styles[0], 0.0, SECONDS)
    second = _through(styles[1], float(rng.choice([-1.0, 1.0])) * pi / 2, *_lead(rng))
    return _meeting((first, second), (_middle_s(first), _middle_s(second) + float(rng.uniform(-6.0, 6.0))))


def _head_on(rng: Rng, styles: list[Style], sizes: list[tuple[float, float]]) -> list[Drive]:
    aside_m = (sizes[0][1] + sizes[1][1]) / 2 + float(rng.uniform(-0.3, 1.0))
    first = _through(styles[0], 0.0, *_lead(rng))
    second = _through(styles[1], pi, *_lead(rng), aside_m)
    return _meeting((first, second), (_middle_s(first), _middle_s(second)))


def _following(rng: Rng, styles: list[Style], sizes: list[tuple[float, float]]) -> list[Drive]:
    """The second one catches up with the first, or would if its way were longer."""
    slow = styles[0]._replace(pace_mps=min(styles[0].pace_mps, 0.6 * styles[1].pace_mps))
    aside_m = float(rng.choice([0.0, (sizes[0][1] + sizes[1][1]) / 2 + 0.6]))
    first = _through(slow, 0.0, *_lead(rng))
    before_s, _ = _lead(rng)
    second = _through(styles[1], 0.0, before_s, float(rng.uniform(-5.0, 5.0)), aside_m)
    return _meeting((first, second), (_middle_s(first), _middle_s(second)))


def _turning(rng: Rng, styles: list[Style], sizes: list[tuple[float, float]]) -> list[Drive]:
    """The first one turns on the spot at the end of its way, or in the middle of it, while the second one passes."""
    (length_m, width_m), (_, other_m) = sizes
    run_m, turn_rad = styles[0].pace_mps * float(rng.uniform(5.0, 12.0)), float(rng.uniform(1.2, pi))
    turn_rad *= float(rng.choice([-1.0, 1.0]))
    nodes = [(-run_m, 0.0), (0.0, 0.0)]
    if rng.random() < 0.5:
        first = driven(_nodes(*nodes), styles[0], 0.0, SECONDS, last_yaw_rad=turn_rad)
        turns_s = first.ends_s - abs(turn_rad) / styles[0].turn_radps
    else:
        nodes.append((8.0 * cos(turn_rad), 8.0 * sin(turn_rad)))
        first = driven(_nodes(*nodes), styles[0], 0.0, SECONDS)
        turns_s = _middle_s(first)
    nearest_m, widest_m = (width_m + other_m) / 2 + 0.5, (length_m + other_m) / 2 + 0.5
    aside_m = float(rng.uniform(nearest_m, max(widest_m, nearest_m + 0.1))) * float(rng.choice([-1.0, 1.0]))
    second = _through(styles[1], float(rng.choice([0.0, pi])), *_lead(rng), aside_m)
    middle_s = turns_s + abs(turn_rad) / styles[0].turn_radps / 2
    return _meeting((first, second), (middle_s, _middle_s(second) + float(rng.uniform(-4.0, 4.0))))


def _stopping(rng: Rng, styles: list[Style], sizes: list[tuple[float, float]]) -> list[Drive]:
    """The way of the first one ends before, or in, the way of the second one."""
    before_s, _ = _lead(rng)
    gap_m = sizes[0][0] / 2 + sizes[1][1] / 2 + float(rng.uniform(-0.5, 1.2))
    end_m = (-gap_m, 0.0)
    first = driven(_nodes((-gap_m - before_s * styles[0].pace_mps, 0.0), end_m), styles[0], 0.0, SECONDS)
    second = _through(styles[1], pi / 2, *_lead(rng))
    return _meeting((first, second), (first.ends_s, _middle_s(second) + float(rng.uniform(-2.0, 2.0))))


def _setting_out(rng: Rng, styles: list[Style], sizes: list[tuple[float, float]]) -> list[Drive]:
    """The first one stands beside the way of the second one, and sets out across it."""
    away_m = sizes[0][0] / 2 + sizes[1][1] / 2 + float(rng.uniform(0.6, 2.5))
    first = driven(_nodes((-away_m, 0.0), (6.0, 0.0)), styles[0], 0.0, SECONDS)
    second = _through(styles[1], pi / 2, *_lead(rng))
    return _meeting((first, second), (_middle_s(first), _middle_s(second) + float(rng.uniform(-6.0, 6.0))))


_WAYS: Mapping[str, Callable[[Rng, list[Style], list[tuple[float, float]]], list[Drive]]] = dict(
    zip(KINDS, (_crossing, _corner, _head_on, _following, _turning, _stopping, _setting_out), strict=True)
)


def _placed(drive: Drive, at_m: Floats, turn_rad: float) -> Drive:
    """A drive of a scene on the floor, turned about the middle of the scene."""
    turned = np.array([[cos(turn_rad), sin(turn_rad)], [-sin(turn_rad), cos(turn_rad)]])
    poses = np.column_stack([drive.poses[:, :2] @ turned + at_m, drive.poses[:, 2] + turn_rad])
    yaws = tuple(None if yaw_rad is None else yaw_rad + turn_rad for yaw_rad in drive.node_yaw_rad)
    return Drive(drive.style, drive.nodes_m @ turned + at_m, drive.node_s, yaws, drive.begins_s, drive.ends_s, poses)
