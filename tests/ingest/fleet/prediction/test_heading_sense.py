"""Headings in degrees, swapped and reversed axes, told by moves; and honest robots that move as strangely."""

from collections.abc import Callable, Iterator
from math import cos, degrees, pi, radians, sin
from random import Random
from typing import Any

import pytest

from ingest.fleet import fleet_report
from ingest.fleet.fleet import Fleet
from ingest.fleet.repeat_status import load
from ingest.port.connection import Connection
from ingest.settings import Datum
from tests.helpers import iso_saying, vda_saying
from tests.helpers.saying import HALL, angle, status
from tests.ingest.fleet.made_fleet import LINE, NOW_S, fleet

RULES = {"heading-in-degrees", "axes-contradict-motion"}
Pose = tuple[float, float, float]
"""x, y and heading."""
Said = tuple[bytes, Connection]
Speaker = Callable[[float, Pose, float], Said]
SIDES = 12
"""Of the way of a robot that drives around."""


def mass(t_s: float, pose: Pose, mps: float) -> Said:
    return status("A-1", t_s, *pose, velocity={"linear": mps}), LINE


def vda(t_s: float, pose: Pose, mps: float) -> Said:
    return vda_saying.state(t_s, *pose, driving=True, velocity={"vx": mps}), vda_saying.line("state")


def iso(t_s: float, pose: Pose, mps: float) -> Said:
    return iso_saying.odometry(t_s, *pose, speed=mps), iso_saying.line("odometry")


def floor(*, fast: bool = False) -> Fleet:
    of = fleet(datums=tuple(Datum(id=name, name=name) for name in (HALL, vda_saying.MAP, iso_saying.CCS)))
    if fast:
        of.use(load())
    return of


def told(of: Fleet, poses: Iterator[Pose], speaker: Speaker = mass, mps: float = 1.0, each_s: float = 1.0) -> set[str]:
    """The rules from which a robot deviates that was in these poses, one after the other."""
    for row, pose in enumerate(poses):
        raw, line = speaker(NOW_S + row * each_s, pose, mps)
        assert of.receive(raw, NOW_S + row * each_s, line) is None
    (robot,) = of.robots.values()
    return RULES & robot.deviations.keys()


def values(of: Fleet) -> list[dict[str, Any]]:
    (sender,) = fleet_report.senders(of, NOW_S)
    return [value for value in sender["odd_values"] if value["rule"] in RULES]


def drive(rounds: int = 2, off_rad: float = 0.0, step_m: float = 1.0) -> Iterator[Pose]:
    """A robot that drives around and keeps this angle between its way and its heading."""
    x, y = 0.0, 0.0
    for side in range(SIDES * rounds):
        way_rad = radians(10.0) + 2 * pi * side / SIDES
        for _ in range(6):
            yield x, y, way_rad + off_rad
            x, y = x + step_m * cos(way_rad), y + step_m * sin(way_rad)


def axes_only(off_rad: float) -> Iterator[Pose]:
    for row in range(60):
        leg, along_m = divmod(row, 10)
        way_rad = leg * pi / 2
        yield along_m * cos(way_rad), along_m * sin(way_rad), way_rad + off_rad


@pytest.mark.parametrize(("speaker", "path"), [(vda, "agvPosition.theta"), (iso, "pose.orientation.yaw")])
def test_headings_in_degrees_are_found(speaker: Speaker, path: str) -> None:
    of = floor()
    assert told(of, ((x, y, degrees(yaw) % 360) for x, y, yaw in drive()), speaker) == {"heading-in-degrees"}
    (value,) = values(of)
    assert value["path"] == path
    assert "radians; the robot moves as if it were in degrees: is it?" in value["reading"]


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("speaker", [mass, vda, iso])
@pytest.mark.parametrize("off_rad", [0.0, pi])
def test_swapped_axes_are_found(speaker: Speaker, off_rad: float, fast: bool) -> None:
    of = floor(fast=fast)
    mps = -1.0 if off_rad else 1.0
    assert told(of, ((y, x, yaw) for x, y, yaw in drive(off_rad=off_rad)), speaker, mps) == {"axes-contradict-motion"}
    assert "as if x and y were swapped: are they?" in values(of)[0]["reading"]


@pytest.mark.parametrize("fast", [False, True])
def test_a_reversed_axis_is_found(fast: bool) -> None:
    of = floor(fast=fast)
    assert told(of, ((x, -y, yaw) for x, y, yaw in drive())) == {"axes-contradict-motion"}
    assert "one axis, or the heading, were reversed" in values(of)[0]["reading"]


def _turns_as_it_likes(random: Random) -> Iterator[Pose]:
    """It can drive in every direction, and changes its heading with every leg."""
    for x, y, yaw in drive(9, step_m=0.7):
        if random.random() < 0.15:
            _turns_as_it_likes.off_rad = random.uniform(-pi, pi)  # type: ignore[attr-defined]
        yield x, y, yaw + getattr(_turns_as_it_likes, "off_rad", 0.0)


def _keeps_its_heading(random: Random) -> Iterator[Pose]:
    heading_rad = random.uniform(-pi, pi)
    return ((x, y, heading_rad) for x, y, _ in drive(9))


def _counts_its_turns(random: Random) -> Iterator[Pose]:
    """Its heading goes on beyond a full turn, in radians."""
    turns = random.randint(2, 30)
    return ((x, y, yaw + 2 * pi * turns) for x, y, yaw in drive(9))


def _is_noisy_and_stands(random: Random) -> Iterator[Pose]:
    return ((random.gauss(0, 0.3), random.gauss(0, 0.3), random.uniform(-pi, pi)) for _ in range(300))


def _circles(random: Random) -> Iterator[Pose]:
    """Sideways around a point, with its front to it."""
    radius_m = random.uniform(2.0, 6.0)
    return ((radius_m * cos(row / radius_m), radius_m * sin(row / radius_m), row / radius_m + pi) for row in range(120))


def _constant(off_rad: float) -> Callable[[Random], Iterator[Pose]]:
    return lambda _: drive(9, off_rad)


HONEST: list[Callable[[Random], Iterator[Pose]]] = [
    _keeps_its_heading,
    _counts_its_turns,
    _is_noisy_and_stands,
    _circles,
]
HONEST += [_constant(off_rad) for off_rad in (0.0, pi, pi / 2, -pi / 2, pi / 4, 2.0)]


@pytest.mark.parametrize("speaker", [mass, vda])
@pytest.mark.parametrize("motion", HONEST)
@pytest.mark.parametrize("mps", [1.0, -1.0])
def test_honest_robots_are_not_accused(
    motion: Callable[[Random], Iterator[Pose]], speaker: Speaker, mps: float
) -> None:
    for seed in range(3):
        assert told(floor(fast=speaker is mass), motion(Random(seed)), speaker, mps) == set()


def test_robots_that_turn_as_they_like_are_not_accused() -> None:
    for seed in range(20):
        assert told(floor(), _turns_as_it_likes(Random(seed)), vda) == set()


@pytest.mark.parametrize("off_rad", [pi / 2, -pi / 2])
def test_sideways_along_the_axes_is_no_evidence_though_it_fits_swapped_ones(off_rad: float) -> None:
    assert told(floor(), axes_only(off_rad)) == set()


@pytest.mark.parametrize(("w", "is_named"), [(0.0, True), (1.0, True), (0.5, False)])
def test_an_angle_in_a_quaternion_is_named(w: float, is_named: bool) -> None:
    of = floor()
    place = {"x": 0.0, "y": 0.0, "planarDatum": HALL, "angle": angle(0.0) | {"z": 1.57, "w": w}}
    of.receive(status("A-1", NOW_S, location=place), NOW_S, LINE)
    (sender,) = fleet_report.senders(of, NOW_S)
    named = [value["reading"] for value in sender["odd_values"] if value["rule"] == "angle-not-unit"]
    assert ["is z the heading as an angle?" in reading for reading in named] == [True] * is_named
