"""Positions in millimetres or centimetres, told by the speed with which they move."""

from collections.abc import Callable, Iterable, Sequence
from random import Random
from typing import Any

import pytest

from ingest.fleet import fleet_report
from ingest.fleet.fleet import Fleet
from ingest.fleet.repeat_status import load
from ingest.port.connection import Connection
from ingest.settings import Datum
from tests.helpers import iso_saying, vda_saying
from tests.helpers.saying import HALL, identity, status
from tests.ingest.fleet.made_fleet import LINE, NOW_S, fleet

RULE = "position-in-other-unit"
Said = tuple[bytes, Connection]
Speaker = Callable[[float, float, float], Said]
"""The message of a robot at a time, at x in whatever unit, at a speed."""


def mass(t_s: float, x: float, mps: float) -> Said:
    return status("A-1", t_s, x, velocity={"linear": mps}), LINE


def vda(t_s: float, x: float, mps: float) -> Said:
    return vda_saying.state(t_s, x, driving=True, velocity={"vx": mps}), vda_saying.line("state")


def iso(t_s: float, x: float, mps: float) -> Said:
    return iso_saying.odometry(t_s, x, speed=mps), iso_saying.line("odometry")


def floor(*, fast: bool = False) -> Fleet:
    of = fleet(datums=tuple(Datum(id=name, name=name) for name in (HALL, vda_saying.MAP, iso_saying.CCS)))
    if fast:
        of.use(load())
    return of


def told(of: Fleet, xs: Iterable[float], *, speaker: Speaker = mass, mps: float = 1.0, each_s: float = 1.0) -> int:
    """How many reports deviate of a robot that is at these places one after the other."""
    for row, x in enumerate(xs):
        raw, line = speaker(NOW_S + row * each_s, x, mps)
        assert of.receive(raw, NOW_S + row * each_s, line) is None
    (robot,) = of.robots.values()
    return robot.deviations.get(RULE, 0)


def values(of: Fleet) -> list[dict[str, Any]]:
    (sender,) = fleet_report.senders(of, NOW_S)
    return [value for value in sender["odd_values"] if value["rule"] == RULE]


@pytest.mark.parametrize(("speaker", "path"), [(mass, "location"), (vda, "agvPosition"), (iso, "pose.locationPoint")])
@pytest.mark.parametrize(("factor", "unit"), [(1000.0, "millimetres"), (100.0, "centimetres")])
def test_positions_that_move_too_fast_by_a_unit_are_found(
    speaker: Speaker, path: str, factor: float, unit: str
) -> None:
    of = floor()
    assert told(of, [factor * row for row in range(6)], speaker=speaker) == 3
    (value,) = values(of)
    assert (value["path"], value["value"], value["count"]) == (path, f"{factor:.0f} m further after 1.0 s", 3)
    question = f"positions move {factor:.0f} times faster than the speed that it sends: are they {unit}?"
    assert question in value["reading"]


def test_positions_are_not_changed() -> None:
    of = floor()
    told(of, [1000.0 * row for row in range(6)])
    (robot,) = of.robots.values()
    assert robot.seen is not None
    assert robot.seen.x_m == 5000.0


def test_a_robot_that_sends_no_speed_is_taken_to_drive_as_fast_as_it_can() -> None:
    of = floor()
    of.receive(identity("A-1", NOW_S, maxSpeed=1.2), NOW_S, LINE)
    for row in range(6):
        of.receive(status("A-1", NOW_S + row, 1000.0 * row), NOW_S + row, LINE)
    assert "than its greatest speed: are they millimetres?" in values(of)[0]["reading"]


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("each_s", [0.1, 1.0, 5.0])
def test_the_fast_path_finds_the_same(each_s: float, fast: bool) -> None:
    for factor, mps in ((1000.0, 1.0), (100.0, 0.5), (100.0, 0.25), (70.0, 0.25)):
        of = floor(fast=fast)
        assert told(of, [factor * mps * each_s * row for row in range(20)], mps=mps, each_s=each_s) == 17


def _carried(random: Random) -> list[float]:
    """It is a kilometre further twice, and drives between."""
    return [
        row + 1000.0 * (row > 5) + 1000.0 * (row > 6) + 1000.0 * (row > 9) + random.gauss(0, 0.05) for row in range(15)
    ]


def _two_with_one_uuid(random: Random) -> list[float]:
    return [row + 100.0 * (row % 2) + random.gauss(0, 0.05) for row in range(30)]


def _lost(random: Random) -> list[float]:
    return [random.uniform(-150.0, 150.0) for _ in range(400)]


def _usual(random: Random) -> list[float]:
    return [row * random.uniform(0.5, 2.0) for row in range(60)]


def _stands(_: Random) -> list[float]:
    return [3.0] * 20


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("motion", [_carried, _two_with_one_uuid, _usual, _stands])
def test_nothing_else_counts(motion: Callable[[Random], Sequence[float]], fast: bool) -> None:
    for seed in range(5):
        assert told(floor(fast=fast), motion(Random(seed))) == 0


def test_a_robot_that_is_lost_is_seldom_taken_for_one_in_another_unit() -> None:
    assert sum(told(floor(), _lost(Random(seed))) for seed in range(5)) < 20


def test_slow_robots_with_noisy_positions_do_not_count() -> None:
    random = Random(1)
    for mps in (0.0, 0.01, 0.1, 0.2):
        assert told(floor(), [100 * mps * row + random.gauss(0, 0.3) for row in range(30)], mps=mps) == 0


def test_a_robot_that_turns_about_counts_again_after_a_few_reports() -> None:
    there = [1000.0 * row for row in range(6)]
    assert told(floor(), [*there, *reversed(there[:-1])]) == 3 + 3
