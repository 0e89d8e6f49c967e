"""Losses: how much time robots lose to which others."""

from dataclasses import replace

import pytest

from deconflict.foresight.losses.loss import LossKind, kind_of
from ingest.batch import Basis
from tests.deconflict.foresight.losses.made_losses import Robot, losses

STOPPED = Robot((0.0, 0.0), 1.0, stops_s=10.0, until_s=18.0)
IN_THE_WAY = Robot((11.6, 0.0), 1.0, stops_s=0.0, until_s=17.0, vendor="Basalt")
FAR_AWAY = Robot((11.6, 9.0), 1.0, stops_s=0.0, until_s=17.0, vendor="Basalt")


def test_a_robot_loses_the_time_that_it_stands_behind_another() -> None:
    (loss,) = losses([STOPPED, IN_THE_WAY], 30)
    assert (loss.robot, loss.by, loss.root) == ("0", "1", "1")
    assert (loss.vendor, loss.by_vendor) == ("Alder", "Basalt")
    assert loss.lost_s == pytest.approx(8.0, abs=0.5)
    assert loss.over_usual_s == pytest.approx(loss.lost_s, abs=0.5)
    assert loss.is_sure


def test_a_robot_that_stands_with_nobody_in_its_way_loses_nothing_to_others() -> None:
    assert losses([STOPPED, FAR_AWAY], 30) == []


def test_a_robot_in_a_crowd_loses_nothing() -> None:
    assert losses([replace(STOPPED, is_crowded=True), IN_THE_WAY], 30) == []


def test_a_robot_that_says_why_it_stands_loses_nothing_to_others() -> None:
    charges = Robot((0.0, 0.0), 1.0, stops_s=10.0, until_s=18.0, state="charging")
    assert losses([charges, IN_THE_WAY], 30) == []


def test_a_robot_that_drives_as_planned_loses_nothing() -> None:
    assert losses([Robot((0.0, 0.0), 1.0), Robot((5.0, 0.0), 1.0)], 30) == []


def test_a_robot_that_withdraws_its_path_does_not_lose_time_to_others() -> None:
    gives_up = Robot((0.0, 0.0), 1.0, stops_s=10.0, until_s=18.0, withdraws_path=True)
    assert losses([gives_up, IN_THE_WAY], 30) == []


def test_a_robot_that_always_creeps_is_not_judged() -> None:
    """From second to second its errors are as large as its motion."""
    creeps = Robot((0.0, 0.0), 0.06, stops_s=10.0, until_s=60.0)
    near = Robot((1.9, 0.0), 0.06, stops_s=0.0, until_s=60.0, vendor="Basalt")
    assert losses([creeps, near], 70) == []


def test_a_robot_that_turns_in_place_loses_nothing() -> None:
    turns = Robot((0.0, 0.0), 1.0, stops_s=10.0, until_s=13.0, turn_radps=1.0)
    assert [loss for loss in losses([turns, IN_THE_WAY], 30) if loss.robot == "0"] == []


def test_a_robot_that_stands_near_an_occupied_crossing_waits_for_who_is_in_it() -> None:
    in_crossing = Robot((13.2, 1.6), 1.0, stops_s=0.0, until_s=17.0, vendor="Basalt")
    (loss,) = losses([STOPPED, in_crossing], 30)
    assert loss.by == "1"
    assert not loss.is_sure


def test_a_robot_without_a_path_loses_the_time_that_it_stands() -> None:
    without_path = Robot((0.0, 0.0), 1.0, stops_s=10.0, until_s=18.0, basis=Basis.VELOCITY)
    (loss,) = losses([without_path, IN_THE_WAY], 30)
    assert loss.by == "1"
    assert loss.lost_s == pytest.approx(8.0, abs=1.0)


def test_who_stands_behind_a_queue_loses_time_to_the_next_and_at_its_root_to_the_first() -> None:
    behind = Robot((-1.5, 0.0), 1.0, stops_s=11.0, until_s=19.0)
    found = {loss.robot: loss for loss in losses([STOPPED, IN_THE_WAY, behind], 30)}
    assert (found["2"].by, found["2"].root, found["2"].kind) == ("0", "1", LossKind.QUEUE)


def test_a_robot_that_crosses_is_the_cause_while_it_is_in_the_way() -> None:
    crosses = Robot((11.4, -11.0), 1.0, heads_up=True, vendor="Basalt")
    waits = Robot((0.0, 0.0), 1.0, stops_s=10.0, until_s=13.0)
    (loss,) = losses([waits, crosses], 30)
    assert (loss.by, loss.kind) == ("1", LossKind.CROSSING)
    assert loss.lost_s == pytest.approx(3.0, abs=0.5)


def test_a_long_loss_is_reported_in_parts_that_add_up() -> None:
    waits = Robot((0.0, 0.0), 1.0, stops_s=10.0, until_s=160.0)
    stands = Robot((11.6, 0.0), 1.0, stops_s=0.0, until_s=159.0, vendor="Basalt")
    parts = losses([waits, stands], 175)
    assert len(parts) == 3
    assert sum(part.lost_s for part in parts) == pytest.approx(150.0, abs=0.5)


def test_a_loss_ends_when_a_robot_of_it_leaves() -> None:
    (loss,) = losses([STOPPED, IN_THE_WAY], 14)
    assert loss.lost_s == pytest.approx(3.0, abs=0.5)


@pytest.mark.parametrize(
    ("turn_rad", "kind"), [(0.2, LossKind.FOLLOWING), (-1.6, LossKind.CROSSING), (3.1, LossKind.HEAD_ON)]
)
def test_the_headings_tell_the_kind_if_the_other_one_drives(turn_rad: float, kind: LossKind) -> None:
    assert kind_of(turn_rad, stands=False, waits=False, for_each_other=False) is kind


def test_robots_that_wait_for_each_other_are_a_deadlock() -> None:
    assert kind_of(3.1, stands=True, waits=True, for_each_other=True) is LossKind.DEADLOCK


def test_the_same_reports_give_the_same_losses() -> None:
    behind = Robot((-1.5, 0.0), 1.0, stops_s=11.0, until_s=19.0)
    robots = [STOPPED, IN_THE_WAY, behind]
    assert losses(robots, 30) == losses(robots, 30) != []
