"""A site service's instructions to robots on errands about places."""

from math import pi

import pytest

from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.simulation.drills.errands import STEP_S, Errand, ErrandGroup, Visit
from deconflict.simulation.drills.site_service import Dispatcher, SituationService
from deconflict.simulation.participants import ALDER, Participant
from deconflict_client.advisory import Action, ActionKind, moment
from tests.deconflict.contention.scenes import aisle, resource
from tests.helpers.made_advisories import situation

NOW_S = 1_790_000_000.0
GEOMETRY = PlaceGeometry(
    [resource("lift", 10, 0, group="lifts"), resource("twin", 10, 5, group="lifts"), resource("parking", 5, 5)],
    [aisle("lane", -2, 8)],
)


def errand(x_m: float = 0.0) -> Errand:
    return Errand(Participant(1, ALDER), (x_m, 0.0), [Visit(10, 0, "lift", 3.0), Visit(20, 0)])


def run(driven: Errand, seconds: float) -> None:
    for _ in range(round(seconds / STEP_S)):
        ErrandGroup([driven]).step(STEP_S)


def test_a_robot_comes_to_its_place_when_it_should() -> None:
    driven = errand()
    dispatcher = Dispatcher(ErrandGroup([driven]), GEOMETRY, NOW_S)
    assert dispatcher.arrive(driven, "lift", 17.0)
    assert driven.comes_s("lift") == pytest.approx(17.0)
    assert not dispatcher.arrive(driven, "lift", 17.1), "too small a change"


def test_a_robot_leaves_the_place_where_it_goes_first_when_it_should() -> None:
    driven = errand()
    dispatcher = Dispatcher(ErrandGroup([driven]), GEOMETRY, NOW_S)
    assert dispatcher.go_first(driven, "parking", 20.0)
    run(driven, 19.8)
    assert driven.at == "parking"
    run(driven, 2.5)
    assert driven.at == ""
    assert not dispatcher.go_first(driven, "lift", 40.0), "it goes there anyway"


def test_a_robot_backs_out_of_a_lane_and_comes_again() -> None:
    driven = errand(x_m=2.0)
    dispatcher = Dispatcher(ErrandGroup([driven]), GEOMETRY, NOW_S)
    assert dispatcher.back_out(driven, "lane", 20.0)
    run(driven, 15.0)
    assert driven.x_m + driven.member.make.body.length_m / 2 < -2.0, "it stands before the lane"
    assert abs(driven.yaw_rad) == pytest.approx(pi, abs=0.02)
    run(driven, 15.0)
    assert driven.x_m > 2.0
    assert not dispatcher.back_out(driven, "parking", 40.0), "no lane"


@pytest.mark.parametrize(
    ("kind", "place", "late_s"),
    [
        ("wait", "lift", 7.0),
        ("take_another_route", "twin", 7.0),
        ("wait", None, 4.0),
        ("slow_down", None, 2.0),
        ("go_first", None, 0.0),
        ("look", None, 0.0),
    ],
)
def test_a_situation_service_carries_out_each_action_once(kind: ActionKind, place: str | None, late_s: float) -> None:
    driven = errand()
    timed = {"seconds": 4.0, "speed_mps": 0.5} if place is None and kind in {"wait", "slow_down"} else {}
    times = {"start_at": moment(NOW_S + 17.0), "end_at": moment(NOW_S + 20.0)} if place else {}
    action = Action(robot=driven.member.uuid, name="A", action=kind, resource=place, **timed, **times)
    advice = {"actions": (action,), "text": "", "since_at": moment(NOW_S)}
    service = SituationService(ErrandGroup([driven]), GEOMETRY, NOW_S)
    revision = situation(1, robots=(driven.member.uuid,), advice=advice, updated_at=moment(NOW_S))
    assert (service.pass_on(revision) is not None) is (late_s > 0)
    assert service.pass_on(revision) is None
    if place:
        assert driven.comes_s(place) == pytest.approx(17.0)
    else:
        assert driven.late_s == pytest.approx(late_s)
