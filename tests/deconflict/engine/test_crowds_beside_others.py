"""A fleet whose robots all report from one place costs others no warning, and people one advisory."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import cos, pi, sin

import pytest

from deconflict.contention.crowds.crowds import FEWEST, HELD_S
from deconflict.engine.claim_lifecycle import CLEAR_AFTER_S
from deconflict.engine.engine import Engine
from deconflict.settings.fleet_factory import fleet_of
from deconflict_client.advisory import ADVISORY, AnyAdvisory, ConflictAdvisory, CrowdAdvisory
from ingest.batch import Batch, Pair
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from tests.deconflict.engine.made_engine import NOW_S, SITE, Course
from tests.helpers.saying import HALL, identity, points, robot, status

PAIRS, CROWDING, CROWDS_S = 25, 120, 15.0
VENDORS = {vendor: Connection(n, vendor=vendor) for n, vendor in enumerate(("Alder", "Corvid", "Mallory"), start=1)}
SPACED_M = 12.0


def crossing(n: int) -> tuple[Course, Course]:
    """Two courses that cross once, 6 to 10 s after the start."""
    x, y, at_s = SPACED_M * (n % 5), SPACED_M * (1 + n // 5), 6.0 + n / 6
    return (lambda t: (x + t - at_s, y, 0.0), lambda t: (x, y + 0.3 + t - at_s, pi / 2))


def at_zero(n: int) -> Course:
    """Does not know where it is."""
    return lambda _: (0.0, 0.0, 0.0)


def criss_cross(n: int) -> Course:
    """Back and forth within three metres."""
    heading = n * 2.4
    return lambda t: (
        1.5 * cos(heading) * sin(0.7 * t + n),
        SPACED_M + 1.5 * sin(heading) * sin(0.7 * t + n),
        heading,
    )


@dataclass
class Floor:
    """Pairs of robots that cross, beside a fleet that reports from one place, and after a while from many."""

    crowding: Callable[[int], Course]
    robots: int = CROWDING
    engine: Engine = field(default_factory=lambda: Engine(SITE))
    revisions: list[AnyAdvisory] = field(default_factory=list)
    most: int = 0
    """Revisions of one pass."""

    def __post_init__(self) -> None:
        self.fleet = fleet_of(SITE, Measures())
        self.courses: dict[str, tuple[str, Course]] = {}
        for n in range(PAIRS):
            for vendor, course in zip(("Alder", "Corvid"), crossing(n), strict=True):
                self.courses[f"{vendor}-{n}"] = vendor, course
        self.courses |= {f"M-{n}": ("Mallory", self._course(n)) for n in range(self.robots)}
        for name, (vendor, _) in self.courses.items():
            self.fleet.receive(identity(name, NOW_S, manufacturerName=vendor), NOW_S, VENDORS[vendor])

    def _course(self, n: int) -> Course:
        course, own = self.crowding(n), (-20.0 - 4.0 * (n % 12), 4.0 * (n // 12), 0.0)
        return lambda t: course(t) if t < CROWDS_S else own

    def run(self, until_s: float) -> None:
        for tick in range(round(until_s * 5)):
            t = tick / 5
            for number, (name, (vendor, course)) in enumerate(self.courses.items()):
                if (tick + number) % 5 == 0:
                    path = points(*((NOW_S + t + k, *course(t + k)) for k in range(1, 11)))
                    message = status(name, NOW_S + t, *course(t), path=None if vendor == "Mallory" else path)
                    self.fleet.receive(message, NOW_S + t, VENDORS[vendor])
            self.engine.receive(Batch.from_bytes(self.fleet.next_batch(NOW_S + t).to_bytes()))
            revisions = self.engine.step(NOW_S + t)
            assert all(ADVISORY.validate_json(revision.model_dump_json()) == revision for revision in revisions)
            self.revisions += revisions
            self.most = max(self.most, len(revisions))

    def raised_s(self) -> dict[Pair, float]:
        """When the first advisory of each pair was raised, after the start."""
        conflicts = (advisory for advisory in reversed(self.revisions) if isinstance(advisory, ConflictAdvisory))
        return {conflict.robots: conflict.raised_at.timestamp() - NOW_S for conflict in conflicts}

    def crowds(self) -> list[CrowdAdvisory]:
        return [revision for revision in self.revisions if isinstance(revision, CrowdAdvisory)]


def assert_meetings_are_announced(floor: Floor) -> None:
    raised_s = floor.raised_s()
    for n in range(PAIRS):
        a, b = sorted((robot(f"Alder-{n}"), robot(f"Corvid-{n}")))
        assert raised_s[a, b] < 6.0 + n / 6 - 2.0


@pytest.mark.parametrize("crowding", [at_zero, criss_cross])
def test_a_crowd_is_one_advisory_and_costs_no_other_warning(crowding: Callable[[int], Course]) -> None:
    floor = Floor(crowding)
    floor.run(CROWDS_S + HELD_S + CLEAR_AFTER_S + 4)
    assert_meetings_are_announced(floor)
    raised, *updated, cleared = floor.crowds()
    assert len(updated) <= 2
    assert (raised.state, cleared.state, {crowd.id for crowd in floor.crowds()}) == ("raised", "cleared", {raised.id})
    assert (raised.vendor, raised.crowded, len(raised.robots), set(raised.vendors)) == (
        "Mallory",
        CROWDING,
        10,
        {"Mallory"},
    )
    assert (raised.location.datum, raised.location.y < SPACED_M + 1) == (HALL, True)
    assert f"{CROWDING} robots of Mallory report from one place" in raised.summary
    assert 0 < cleared.updated_at.timestamp() - NOW_S - CROWDS_S - HELD_S < CLEAR_AFTER_S + 2
    assert len(floor.revisions) < 40 * PAIRS
    assert floor.most <= 100


def test_robots_that_meet_where_others_crowd_are_warned_of_each_other_and_of_few_of_the_crowd() -> None:
    floor = Floor(criss_cross)
    floor.run(10.0)
    assert_meetings_are_announced(floor)
    first = {robot("Alder-0"), robot("Corvid-0")}
    mixed = [conflict for conflict in floor.engine.conflicts() if len(first.intersection(conflict.robots)) == 1]
    assert 0 < len(mixed) <= 12
    between = [revision.recommendation for revision in floor.revisions if set(revision.robots) == first]
    assert any(advice and advice.holds for advice in between), "as if there were no crowd"


def test_conflicts_among_robots_end_when_a_crowd_grows_around_them() -> None:
    floor = Floor(criss_cross, 8)
    floor.run(6.0)
    within = {conflict.id for conflict in floor.engine.conflicts() if set(conflict.vendors) == {"Mallory"}}
    assert within
    floor.courses |= {f"M-{n}": ("Mallory", criss_cross(n)) for n in range(8, 30)}
    for name in (f"M-{n}" for n in range(8, 30)):
        floor.fleet.receive(identity(name, NOW_S, manufacturerName="Mallory"), NOW_S, VENDORS["Mallory"])
    floor.run(8.0)
    assert not [conflict for conflict in floor.engine.conflicts() if set(conflict.vendors) == {"Mallory"}]
    ended = [revision for revision in floor.revisions if revision.id in within and revision.state == "cleared"]
    assert {advisory.cleared_because for advisory in ended} >= {
        "both report from a place with many others of their vendors"
    }


def few(courses: dict[str, Course]) -> Floor:
    """These robots and no pairs: of Mallory, but for those whose names begin with A."""
    floor = Floor(at_zero, 0)
    floor.courses = {name: ("Alder" if name[0] == "A" else "Mallory", course) for name, course in courses.items()}
    for name, (vendor, _) in floor.courses.items():
        floor.fleet.receive(identity(name, NOW_S, manufacturerName=vendor), NOW_S, VENDORS[vendor])
    return floor


def test_a_robot_that_crosses_the_way_of_a_crowd_is_warned_without_advice() -> None:
    convoy: dict[str, Course] = {f"M-{n}": lambda t: (t - 12.0, 0.0, 0.0) for n in range(12)}
    floor = few(convoy | {"A": lambda t: (0.0, t - 12.0, pi / 2)})
    floor.run(10.0)
    assert 0 < len(floor.engine.conflicts()) <= 3
    assert not any(revision.recommendation for revision in floor.revisions)


def test_the_conflicts_of_robots_end_in_the_pass_in_which_they_become_a_crowd() -> None:
    floor, conflicts = few({f"M-{n}": at_zero(n) for n in range(FEWEST)}), []
    for n, name in enumerate(floor.courses):
        floor.fleet.receive(status(name, NOW_S), NOW_S, VENDORS["Mallory"])
        floor.engine.receive(Batch.from_bytes(floor.fleet.next_batch(NOW_S + n / 10).to_bytes()))
        floor.engine.step(NOW_S + n / 10)
        floor.engine.measures.as_document()
        conflicts.append(floor.engine.measures.values["deconflict_conflicts"][()])
    assert conflicts == [0, 1, 3, 6, 10, 15, 21, 28, 0]
