"""Visualizations that name the map otherwise than the states of their robot."""

import pytest

from tests.helpers.vda_saying import MAP, position, state, vda
from tests.ingest.languages.vda5050.made_vda import Listener, T


def seen(s: float, map_id: str, x: float = 0.0) -> tuple[str, bytes]:
    return "visualization", vda(T + s, agvPosition=position(x, mapId=map_id))


def stated(s: float, map_id: str = MAP, x: float = 0.0) -> tuple[str, bytes]:
    return "state", state(T + s, agvPosition=position(x, mapId=map_id))


def datums(*messages: tuple[str, bytes]) -> list[str]:
    listener = Listener()
    return [listener.status_after(message).datum for message in messages]


def test_their_first_name_stands_for_the_map_of_the_states() -> None:
    assert datums(stated(0), seen(0.5, "default"), seen(1, "default")) == [MAP, MAP, MAP]
    status = Listener().status_after(stated(0), seen(0.5, "Default"))
    assert status.findings == ("map-of-state",)
    assert (status.oddities[0].value, status.oddities[0].reading) == ('"Default"', MAP)


def test_so_does_one_that_comes_again_after_a_state_of_another() -> None:
    assert datums(seen(0, "default"), stated(1), seen(1.5, "default")) == ["default", MAP, MAP]


def test_a_robot_that_changes_the_floor_is_on_the_new_one_at_once() -> None:
    ride = (stated(0, "f1"), seen(0.5, "f1"), seen(1.0, "f2"), stated(1.5, "f2"), seen(2.0, "f2"), seen(2.5, "f1"))
    assert datums(*ride) == ["f1", "f1", "f2", "f2", "f2", "f1"]


def test_a_name_that_a_state_has_stands_for_no_other() -> None:
    named = (stated(0), seen(0.5, "f2"), stated(1.0, "f2"), seen(1.5, "f2"), stated(2.0), stated(3.0), seen(9.0, "f2"))
    assert datums(*named) == [MAP, MAP, "f2", "f2", MAP, MAP, "f2"]


@pytest.mark.parametrize("x", [20.0, -9.0])
def test_a_name_at_another_place_is_another_map(x: float) -> None:
    assert datums(stated(0), seen(0.5, "default", x), stated(1), seen(1.5, "default", x))[3] == "default"
