"""Headings and velocities that only one of a robot's topics fills in."""

from math import pi
from typing import Any

import pytest

from tests.helpers.vda_saying import position, state, visualization
from tests.ingest.languages.vda5050.made_vda import Listener, T

SAID = {"state": state, "visualization": visualization}
ZERO = {"vx": 0.0, "vy": 0.0, "omega": 0.0}


def said(
    kind: str, s: float, y: float, theta: float, velocity: dict[str, Any] | None, driving: bool = True
) -> tuple[str, bytes]:
    keys = {"driving": driving} if kind == "state" else {}
    return kind, SAID[kind](T + s, 0.0, y, agvPosition=position(0.0, y, theta), velocity=velocity, **keys)


@pytest.mark.parametrize(("fills", "other"), [("state", "visualization"), ("visualization", "state")])
def test_zeros_of_a_topic_that_never_has_others_are_left_out_if_another_has(fills: str, other: str) -> None:
    moving = said(fills, 0.0, 0.0, pi / 2, {"vx": 0.8})
    at_once = Listener().status_after(moving, said(other, 0.1, 0.08, 0.0, ZERO))
    assert (at_once.linear_mps, at_once.yaw_rad) == (None, pi / 2)
    later = Listener().status_after(moving, said(other, 0.5, 0.4, 0.0, ZERO))
    assert "heading-missing" in later.findings
    standing = Listener().status_after(
        moving, said(other, 0.5, 0.4, 0.3, {"vx": 0.8}), said(other, 1.0, 0.4, 0.0, ZERO)
    )
    assert (standing.linear_mps, standing.yaw_rad) == (0.0, 0.0)


def test_zeros_are_believed_if_no_topic_has_others() -> None:
    status = Listener().status_after(said("state", 0.0, 0.0, 0.0, ZERO), said("visualization", 0.5, 0.0, 0.0, ZERO))
    assert (status.linear_mps, status.yaw_rad) == (0.0, 0.0)


def test_a_robot_that_says_it_does_not_drive_stands_though_its_states_never_had_a_speed() -> None:
    moving = said("visualization", 0.0, 0.0, 0.0, {"vx": 1.0})
    status = Listener().status_after(moving, said("state", 1.0, 0.5, 0.0, ZERO, driving=False))
    assert status.linear_mps == 0.0
