"""Robots that a person takes off the floor, and robots that are heard where they can't have driven to."""

from typing import Any

import pytest

from ingest.batch import Batch
from ingest.fleet.fleet import Fleet
from ingest.recording.operator_events import OffFloorMark
from tests.helpers.saying import HALL, LOFT, identity, robot, status
from tests.ingest.fleet.made_fleet import LINE, NOW_S, counted, document, fleet


def say(of: Fleet, t: float, x: float = 0.0, mps: float = 0.0, **replaced: Any) -> Batch:
    fields = {"operationalState": "navigating" if mps else "idle", "velocity": {"linear": mps}} | replaced
    of.receive(status("A", NOW_S + t, x, **fields), NOW_S + t, LINE)
    return of.next_batch(NOW_S + t)


def off_the_floor(at_s: float = 2.0, x_m: float = 1.0) -> Fleet:
    """A robot that stood somewhere, until a person took it off the floor."""
    of = fleet()
    of.receive(identity("A", NOW_S), NOW_S, LINE)
    for t in range(2):
        say(of, float(t), x_m)
    of.off_floor.note(OffFloorMark(robot("A"), NOW_S + at_s, is_off=True, by="Petra", datum=HALL, x_m=x_m))
    return of


def test_a_robot_off_the_floor_is_gone_from_the_next_batch_on() -> None:
    of = off_the_floor()
    batch = of.next_batch(NOW_S + 2.0)
    assert (batch.robots, batch.gone, batch.off_floor) == ((), (robot("A"),), (robot("A"),))
    batch = of.next_batch(NOW_S + 3.0, everything=True)
    assert (batch.robots, batch.gone, batch.off_floor) == ((), (), ())
    assert of.snapshot(NOW_S + 3.0).robots == ()


@pytest.mark.parametrize(
    ("x_m", "mps", "changed"),
    [(1.0, 0.0, {}), (1.8, 0.0, {}), (1.0, 0.7, {}), (1.2, 0.7, {})],
    ids=["at its place", "within the noise", "wheels that turn on a bench", "hardly moved"],
)
def test_a_robot_that_stands_where_it_was_stays_off(x_m: float, mps: float, changed: dict[str, Any]) -> None:
    of = off_the_floor()
    for t in (3.0, 4.0, 5.0):
        assert say(of, t, x_m, mps, **changed).robots == ()
    found = document(of, "A", NOW_S + 5.0)
    assert found["off_floor"]["still_heard"]
    assert (found["off_floor"]["by"], found["compared"]) == ("Petra", False)


@pytest.mark.parametrize(
    ("x_m", "mps", "floor"), [(2.2, 0.0, HALL), (1.5, 0.7, HALL), (1.0, 0.0, LOFT)], ids=["away", "drives", "floor"]
)
def test_a_robot_that_is_heard_elsewhere_is_back_at_once(x_m: float, mps: float, floor: str) -> None:
    of = off_the_floor()
    of.next_batch(NOW_S + 2.0)
    place = {"x": x_m, "y": 0.0, "planarDatum": floor, "angle": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    assert say(of, 3.0, mps=mps, location=place).robots == (robot("A"),)
    assert counted(of, "robots_moved_total")["Alder", "off_floor"] == 1
    assert document(of, "A", NOW_S + 3.0)["off_floor"] is None
    (back,) = of.off_floor.take_returned()
    assert (back.uuid, back.at_s, back.is_off) == (robot("A"), NOW_S + 3.0, False)


def test_taking_it_back_is_one_statement_and_both_may_be_repeated() -> None:
    of = off_the_floor()
    again = OffFloorMark(robot("A"), NOW_S + 2.5, is_off=True, by="Quentin", datum=HALL, x_m=9.0)
    assert not of.off_floor.note(again)
    assert of.off_floor.marks[robot("A")].by == "Petra"
    of.next_batch(NOW_S + 2.0)
    back = OffFloorMark(robot("A"), NOW_S + 3.0, is_off=False, by="Quentin")
    assert of.off_floor.note(back)
    assert not of.off_floor.note(back)
    assert of.next_batch(NOW_S + 3.0).robots == (robot("A"),)


def test_a_click_that_is_taken_back_before_a_batch_changes_nothing() -> None:
    of = off_the_floor()
    of.off_floor.note(OffFloorMark(robot("A"), NOW_S + 2.0, is_off=False))
    batch = of.next_batch(NOW_S + 2.0)
    assert (batch.robots, batch.gone, batch.off_floor) == ((robot("A"),), (), ())


def test_a_statement_that_comes_again_after_the_robot_came_back_is_ignored() -> None:
    of = off_the_floor()
    mark = of.off_floor.marks[robot("A")]
    say(of, 3.0, 5.0, 1.0)
    assert not of.off_floor.note(mark)
    assert of.off_floor.note(OffFloorMark(robot("A"), NOW_S + 4.0, is_off=True, datum=HALL, x_m=5.0))


def jumping(gap_s: float, x_m: float, mps: float = 0.0, **reading: Any) -> tuple[Fleet, Batch]:
    """A robot that stands or drives, and is heard elsewhere after a time."""
    of = fleet(**reading)
    of.receive(identity("A", NOW_S, maxSpeed=2.0), NOW_S, LINE)
    for t in range(3):
        say(of, float(t), mps * t, mps)
    return of, say(of, 2.0 + gap_s, 2.0 * mps + x_m, mps)


def test_a_robot_that_stood_and_is_heard_out_of_reach_was_moved_by_hand() -> None:
    of, batch = jumping(3.0, 14.2)
    assert batch.began_anew == (robot("A"),)
    assert Batch.from_bytes(batch.to_bytes()).began_anew == (robot("A"),)
    found = document(of, "A")
    assert found["moved"]["sentence"] == "was moved by hand or its localisation jumped: 14.2 m in 3 s"
    assert found["forecast"]["basis"] == "stationary"
    assert counted(of, "robots_moved_total") == {("Alder", "by_hand"): 1}
    assert not {"speed-contradicts-motion", "heading-contradicts-motion"} & found["deviations"].keys()
    assert say(of, 6.0, 14.2).began_anew == ()


@pytest.mark.parametrize(
    ("gap_s", "x_m", "mps"),
    [(3.0, 6.0, 0.0), (1.0, 1.8, 0.0), (8.0, 20.0, 0.0), (3.0, 14.2, 1.0)],
    ids=["drives off", "at once", "after a silence", "drove before"],
)
def test_what_a_robot_can_have_driven_is_no_move_by_hand(gap_s: float, x_m: float, mps: float) -> None:
    of, batch = jumping(gap_s, x_m, mps)
    assert batch.began_anew == ()
    assert document(of, "A")["moved"] is None


def test_a_robot_that_drove_and_is_silent_may_have_been_moved() -> None:
    assert jumping(8.0, 40.0, 1.0)[1].began_anew == (robot("A"),)
