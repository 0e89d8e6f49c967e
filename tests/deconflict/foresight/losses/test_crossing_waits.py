"""What robots of two vendors lose that stand for each other before a crossing in which nobody is."""

from dataclasses import replace
from itertools import pairwise
from random import Random
from typing import Any

import pytest

from deconflict.foresight.losses.loss import Loss, LossKind
from deconflict.foresight.motion_assumptions import CROSSING_S
from ingest.batch import Basis
from tests.deconflict.foresight.losses.made_losses import Robot, losses

UNTIL_S = 40.0


def standoff(number: int) -> tuple[Robot, Robot]:
    """Two that stop too far from each other for either body to be near the other's way."""
    draw = Random(number)
    stops_s = draw.randint(8, 10), draw.randint(8, 12)
    before_m = draw.uniform(2.6, 3.8), draw.uniform(2.6, 3.8)
    waits: dict[str, Any] = {"state": "waitingExternalEvent", "withdraws_path": True} if number % 2 else {}
    basis = (Basis.PATH, Basis.ORDER)[number % 2]
    east = Robot((-before_m[0] - stops_s[0], 0.0), 1.0, stops_s=stops_s[0], until_s=UNTIL_S, basis=basis, **waits)
    north = Robot(
        (0.0, -before_m[1] - stops_s[1]), 1.0, stops_s[1], UNTIL_S, heads_up=True, vendor="Basalt", basis=basis, **waits
    )
    return east, north


def lost_s(found: list[Loss], robot: str, kind: LossKind = LossKind.DEADLOCK) -> float:
    return sum(loss.lost_s for loss in found if (loss.robot, loss.kind) == (robot, kind))


@pytest.mark.parametrize("number", range(6))
def test_the_standing_of_both_is_booked_from_when_both_stand(number: int) -> None:
    robots = standoff(number)
    both_s = UNTIL_S - max(robot.stops_s for robot in robots)
    found = [loss for loss in losses(robots, 45) if loss.lost_s > 3.0]
    assert {(loss.robot, loss.by, loss.root) for loss in found} == {("0", "1", "1"), ("1", "0", "0")}
    assert LossKind.DEADLOCK in {loss.kind for loss in found}
    for robot, own in zip("01", robots, strict=True):
        own_s = UNTIL_S - own.stops_s
        assert both_s - 2.0 <= sum(loss.lost_s for loss in found if loss.robot == robot) <= own_s + 2.0
    assert all(loss.over_usual_s <= loss.lost_s + 0.1 for loss in found)


def test_nothing_is_booked_twice_over_parts_of_a_long_wait() -> None:
    robots = tuple(replace(robot, until_s=200.0) for robot in standoff(0))
    found = losses(robots, 190)
    for robot in "01":
        parts = sorted((loss.from_s, loss.until_s) for loss in found if loss.robot == robot)
        assert len(parts) > 2
        assert all(until_s <= from_s for (_, until_s), (from_s, _) in pairwise(parts))
        assert lost_s(found, robot) <= sum(until_s - from_s for from_s, until_s in parts) + 0.1


@pytest.mark.parametrize(
    "changes",
    [
        {"vendor": "Alder"},
        {"state": "charging"},
        {"stops_s": UNTIL_S - CROSSING_S + 1},
        {"basis": Basis.VELOCITY},
        {"start": (0.0, -30.0)},
    ],
    ids=["one vendor", "it charges", "it has just stopped", "it says no way", "it is far away"],
)
@pytest.mark.parametrize("number", range(2))
def test_no_mutual_wait_is_booked_of_anything_else(changes: dict[str, Any], number: int) -> None:
    east, north = standoff(number)
    found = losses([east, replace(north, **changes)], 39)
    if changes.get("vendor") == "Alder":
        found = [loss for loss in found if loss.kind is LossKind.DEADLOCK and number % 2]
    assert not lost_s(found, "0")
    assert not lost_s(found, "1")


@pytest.mark.parametrize("number", range(2))
def test_who_stands_behind_somebody_in_the_crossing_waits_for_that_one(number: int) -> None:
    in_crossing = Robot((-12.0, 0.6), 1.0, stops_s=12.0, until_s=UNTIL_S, vendor="Chert")
    found = losses([*standoff(number), in_crossing], 39)
    assert not lost_s(found, "0")
    assert not lost_s(found, "1")
