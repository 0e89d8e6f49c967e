"""Messages through fleet and engine, tick by tick, as the service and replay drive them."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import pi
from typing import Any

import pytest

from deconflict.advisory import AdvisoryState, ConflictAdvisory, EncounterClass
from deconflict.engine.engine import Engine
from deconflict.engine.load_shedding import Effort
from deconflict.settings.site import Conflict, Site
from ingest.batch import Batch
from ingest.fleet.fleet import Fleet
from ingest.fleet.quarantine import Quarantine
from ingest.fleet.vendor_registry import Vendors
from ingest.frames.frame_registry import Frames
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Datum
from tests.helpers.saying import HALL, LOFT, identity, points, robot, status

SITE = Site(
    name="Test floor",
    datums=(Datum(id=HALL, name="Hall"), Datum(id=LOFT, name="Loft")),
    conflict=Conflict(clearance_m=0.3, confirm=(2, 3)),
)
NOW_S = 1_790_000_000.0
LINE = Connection(1)

Course = Callable[[float], tuple[float, float, float]]
"""Seconds since the start to x, y, yaw."""


def eastward(speed_mps: float = 1.0, x: float = 0.0, y: float = 0.0) -> Course:
    return lambda t: (x + speed_mps * t, y, 0.0)


def northward(speed_mps: float = 1.0, x: float = 0.0, y: float = 0.0) -> Course:
    return lambda t: (x, y + speed_mps * t, pi / 2)


def standing(x: float, y: float = 0.0) -> Course:
    return lambda _: (x, y, 0.0)


@dataclass
class Floor:
    """Robots that report once a second, and an engine that steps four times a second."""

    courses: dict[str, Course]
    datum: dict[str, str] = field(default_factory=dict)
    silent_from_s: dict[str, float] = field(default_factory=dict)
    site: Site = SITE
    makers: dict[str, str] = field(default_factory=dict)
    effort: Effort = Effort.FULL
    pending: dict[int, int] = field(default_factory=dict)
    """By step, the answers that were not there; as the engine says where it is not given."""
    advisories: list[ConflictAdvisory] = field(default_factory=list)

    def __post_init__(self) -> None:
        frames = Frames(self.site.datums, self.site.vendors)
        self.fleet = Fleet(Vendors(()), frames, self.site.reading, Measures(), Quarantine())
        self.engine = Engine(self.site)

    def run(self, until_s: float, from_s: float = 0.0) -> list[ConflictAdvisory]:
        """The revisions of this stretch."""
        told: list[ConflictAdvisory] = []
        for tick in range(round(from_s * 4), round(until_s * 4)):
            t = tick / 4
            if tick % 4 == 0:
                for name in self.courses:
                    if t < self.silent_from_s.get(name, float("inf")):
                        self._report(name, t)
            self.engine.receive(Batch.from_bytes(self.fleet.cut(NOW_S + t).to_bytes()))
            pending = self.pending.setdefault(tick, self.engine.pending())
            revisions = self.engine.step(NOW_S + t, self.effort, pending)
            told += [one for one in revisions if isinstance(one, ConflictAdvisory)]
        self.advisories += told
        return told

    def _report(self, name: str, t: float) -> None:
        course, datum = self.courses[name], self.datum.get(name, HALL)
        if t == 0:
            self.fleet.receive(identity(name, NOW_S, manufacturerName=self.makers.get(name, "Alder")), NOW_S, LINE)
        x, y, yaw = course(t)
        path = points(*((NOW_S + t + i, *course(t + i)) for i in range(1, 11)))
        location = {"x": x, "y": y, "angle": path[0]["angle"], "planarDatum": datum}
        said: dict[str, Any] = {"path": path, "location": location}
        self.fleet.receive(status(name, NOW_S + t, yaw_rad=yaw, **said), NOW_S + t, LINE)


def states(advisories: list[ConflictAdvisory]) -> list[AdvisoryState]:
    return [one.state for one in advisories if one.state is not AdvisoryState.UPDATED]


def test_two_that_cross_have_one_advisory_from_raised_to_cleared() -> None:
    floor = Floor({"A": eastward(x=-12.0), "B": northward(y=-12.0)})
    told = floor.run(30)
    assert states(told) == [AdvisoryState.RAISED, AdvisoryState.CLEARED]
    assert {one.id for one in told} == {told[0].id}
    assert [one.revision for one in told] == list(range(1, len(told) + 1))
    first = told[0]
    assert first.encounter_class is EncounterClass.CROSSING
    assert first.min_separation_m == 0
    assert first.robots == tuple(sorted((robot("A"), robot("B"))))
    assert first.location.datum == HALL
    # two 1.0 x 0.5 m robots at right angles: within 0.3 m from 11.1 s on
    assert first.predicted_at.timestamp() - NOW_S == pytest.approx(12 - 0.75 - 0.15, abs=0.2)
    assert first.time_to_conflict_s > 7


def test_two_that_pass_with_room_have_none() -> None:
    assert Floor({"A": eastward(), "B": eastward(-1.0, 15.0, 1.0)}).run(20) == []


def test_two_that_pass_within_the_clearance_are_told_how_close() -> None:
    told = Floor({"A": eastward(), "B": eastward(-1.0, 15.0, 0.7)}).run(25)
    assert states(told) == [AdvisoryState.RAISED, AdvisoryState.CLEARED]
    assert told[0].min_separation_m == pytest.approx(0.2, abs=2e-3)
    assert told[0].encounter_class is EncounterClass.HEAD_ON


def test_two_that_begin_close_and_draw_apart_do_not_alert() -> None:
    assert Floor({"A": eastward(), "B": eastward(-1.0, -1.1)}).run(10) == []


def test_two_that_stand_side_by_side_do_not_alert() -> None:
    assert Floor({"A": standing(0), "B": standing(1.1)}).run(10) == []


def test_a_silent_robot_stays_an_obstacle_and_grows() -> None:
    floor = Floor({"A": standing(0.0)}, silent_from_s={"A": 1.0})
    floor.run(400)
    floor.courses["B"] = eastward(-1.0, 412.0, 0.9)
    told = floor.run(420, from_s=400)
    assert AdvisoryState.RAISED in states(told)
    assert told[0].encounter_class is EncounterClass.STATIONARY_OBSTACLE


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
    floor.engine.receive(floor.fleet.cut(NOW_S + 6, everything=True))
    after = floor.run(30, from_s=6)
    assert {one.id for one in before + after} == {before[0].id}
    assert states(after) == [AdvisoryState.CLEARED]


def test_an_engine_for_a_changed_site_goes_on_with_what_is_open_and_learned() -> None:
    floor = Floor({"A": eastward(x=-12.0), "B": northward(y=-12.0)})
    before = floor.run(6)
    wider = SITE.model_copy(update={"conflict": Conflict(clearance_m=0.5)})
    renewed = floor.engine.renewed(wider)
    knows, knew, new = (str(one.learned()["ledger"]) for one in (renewed, floor.engine, Engine(wider)))
    assert knows == knew != new
    floor.engine = renewed
    floor.engine.receive(floor.fleet.cut(NOW_S + 6, everything=True))
    after = floor.run(30, from_s=6)
    assert {one.id for one in before + after} == {before[0].id}
    assert after[-1].state is AdvisoryState.CLEARED
    assert {one.clearance_m for one in after[:-1]} <= {0.3, 0.5}


def test_the_same_messages_and_ticks_give_the_same_advisories() -> None:
    def told() -> list[str]:
        courses = {f"R{i}": eastward(1.0, -3.0 * i, 0.4 * i) for i in range(5)}
        courses |= {f"S{i}": northward(0.8, 3.0 * i, -2.0 * i) for i in range(5)}
        return [one.model_dump_json() for one in Floor(courses).run(25)]

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
