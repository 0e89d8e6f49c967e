"""Messages through fleet and engine, tick by tick, as the service and replay drive them."""

from dataclasses import replace

import pytest

from deconflict.engine.engine import Engine
from deconflict.settings.site import Conflict
from deconflict_client.advisory import AdvisoryState, ConflictAdvisory, EncounterClass
from tests.deconflict.engine.made_engine import NOW_S, SITE, Course, Floor, eastward, northward
from tests.helpers.saying import HALL, LOFT, robot


def standing(x: float, y: float = 0.0) -> Course:
    return lambda _: (x, y, 0.0)


def states(advisories: list[ConflictAdvisory]) -> list[AdvisoryState]:
    return [advisory.state for advisory in advisories if advisory.state is not AdvisoryState.UPDATED]


def test_two_that_cross_have_one_advisory_from_raised_to_cleared() -> None:
    floor = Floor({"A": eastward(x=-12.0), "B": northward(y=-12.0)})
    advisories = floor.run(30)
    assert states(advisories) == [AdvisoryState.RAISED, AdvisoryState.CLEARED]
    assert {advisory.id for advisory in advisories} == {advisories[0].id}
    assert [advisory.revision for advisory in advisories] == list(range(1, len(advisories) + 1))
    first = advisories[0]
    assert first.encounter_class is EncounterClass.CROSSING
    assert first.min_separation_m == 0
    assert first.robots == tuple(sorted((robot("A"), robot("B"))))
    assert first.location.datum == HALL
    # two 1.0 x 0.5 m robots at right angles: within 0.3 m from 11.1 s on
    assert first.predicted_at.timestamp() - NOW_S == pytest.approx(12 - 0.75 - 0.15, abs=0.2)
    assert first.time_to_conflict_s > 7


def test_two_that_pass_with_room_have_none() -> None:
    assert Floor({"A": eastward(), "B": eastward(-1.0, 15.0, 1.0)}).run(20) == []


def test_two_that_pass_within_the_clearance_have_their_separation_in_the_advisory() -> None:
    advisories = Floor({"A": eastward(), "B": eastward(-1.0, 15.0, 0.7)}).run(25)
    assert states(advisories) == [AdvisoryState.RAISED, AdvisoryState.CLEARED]
    assert advisories[0].min_separation_m == pytest.approx(0.2, abs=2e-3)
    assert advisories[0].encounter_class is EncounterClass.HEAD_ON


def test_two_that_begin_close_and_draw_apart_do_not_alert() -> None:
    assert Floor({"A": eastward(), "B": eastward(-1.0, -1.1)}).run(10) == []


def test_a_pair_without_an_advisory_is_forgotten_once_both_have_left() -> None:
    floor = Floor({"A": standing(0), "B": standing(1.1)})
    floor.run(3)
    assert len(floor.engine._conflicts.pairs) == 1
    floor.engine.receive(replace(floor.fleet.next_batch(NOW_S + 3), gone=(robot("A"), robot("B"))))
    floor.engine.step(NOW_S + 3)
    assert len(floor.engine._conflicts.pairs) == 0


def test_two_that_stand_side_by_side_do_not_alert() -> None:
    assert Floor({"A": standing(0), "B": standing(1.1)}).run(10) == []


def test_a_silent_robot_stays_an_obstacle_and_grows() -> None:
    floor = Floor({"A": standing(0.0)}, silent_from_s={"A": 1.0})
    floor.run(400)
    floor.courses["B"] = eastward(-1.0, 412.0, 0.9)
    advisories = floor.run(420, from_s=400)
    assert AdvisoryState.RAISED in states(advisories)
    assert advisories[0].encounter_class is EncounterClass.STATIONARY_OBSTACLE


def test_a_robot_that_reports_does_not_grow() -> None:
    floor = Floor({"A": standing(0.0), "B": eastward(-1.0, 60.0, 0.9)})
    assert floor.run(70) == []


@pytest.mark.parametrize("other", [LOFT, "0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1bff", ""])
def test_robots_of_different_or_unknown_datums_are_never_compared(other: str) -> None:
    crossing = {"A": eastward(x=-5.0), "B": northward(y=-5.0)}
    assert Floor(crossing, datum={"B": other}).run(12) == []


def test_robots_that_share_an_unknown_datum_are() -> None:
    crossing = {"A": eastward(x=-5.0), "B": northward(y=-5.0)}
    shared = "0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1bff"
    assert Floor(crossing, datum={"A": shared, "B": shared}).run(12)


def test_an_engine_that_restarts_goes_on_with_the_same_advisory() -> None:
    floor = Floor({"A": eastward(x=-12.0), "B": northward(y=-12.0)})
    before = floor.run(6)
    floor.engine = Engine(SITE, [before[-1]], {before[-1].robots: 1})
    floor.engine.receive(floor.fleet.next_batch(NOW_S + 6, everything=True))
    after = floor.run(30, from_s=6)
    assert {advisory.id for advisory in before + after} == {before[0].id}
    assert states(after) == [AdvisoryState.CLEARED]


def test_an_engine_for_a_changed_site_goes_on_with_what_is_open_and_learned() -> None:
    floor = Floor({"A": eastward(x=-12.0), "B": northward(y=-12.0)})
    before = floor.run(6)
    wider = SITE.model_copy(update={"conflict": Conflict(clearance_m=0.5)})
    renewed = floor.engine.renewed(wider)
    knows, knew, new = (str(engine.learned()["ledger"]) for engine in (renewed, floor.engine, Engine(wider)))
    assert knows == knew != new
    floor.engine = renewed
    floor.engine.receive(floor.fleet.next_batch(NOW_S + 6, everything=True))
    after = floor.run(30, from_s=6)
    assert {advisory.id for advisory in before + after} == {before[0].id}
    assert after[-1].state is AdvisoryState.CLEARED
    assert {advisory.clearance_m for advisory in after[:-1]} <= {0.3, 0.5}


def test_the_same_messages_and_ticks_give_the_same_advisories() -> None:
    def told() -> list[str]:
        courses = {f"R{i}": eastward(1.0, -3.0 * i, 0.4 * i) for i in range(5)}
        courses |= {f"S{i}": northward(0.8, 3.0 * i, -2.0 * i) for i in range(5)}
        return [advisory.model_dump_json() for advisory in Floor(courses).run(25)]

    assert told()
    assert told() == told()


def test_open_advisories_and_events_are_counted() -> None:
    floor = Floor({"A": eastward(x=-12.0), "B": northward(y=-12.0)})
    floor.run(5)
    floor.engine.measures.as_document()
    assert sum(floor.engine.measures.values["deconflict_advisories_open"].values()) == 1
    floor.run(30, from_s=5)
    floor.engine.measures.as_document()
    assert floor.engine.measures.values["deconflict_advisories_open"] == {}
    totals = floor.engine.measures.values["deconflict_advisories_total"]
    assert totals["conflict", "raised"] == totals["conflict", "cleared"] == 1


@pytest.mark.parametrize(("then", "outcome"), [(northward(y=-12.0), "met"), (standing(0.0, -7.0), "not_met")])
def test_a_conflict_that_is_over_is_counted_by_whether_they_met(then: Course, outcome: str) -> None:
    floor = Floor({"A": eastward(x=-12.0), "B": northward(y=-12.0)})
    floor.run(5)
    floor.courses["B"] = then
    floor.run(30, from_s=5)
    assert states(floor.advisories)[-1] is AdvisoryState.CLEARED
    assert floor.engine.measures.values["deconflict_conflicts_ended_total"] == {("Alder", outcome): 1}
