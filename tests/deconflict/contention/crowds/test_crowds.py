"""From overlapping robots to crowds: how many, for how long, and where."""

import pytest

from deconflict.contention.crowds.crowds import FEWEST, HEARD_S, HELD_S, Crowds
from deconflict.foresight.presence.live_robots import LiveRobots
from deconflict.settings.fleet_factory import fleet_of
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from tests.deconflict.engine.made_engine import NOW_S, SITE
from tests.helpers.saying import HALL, LOFT, identity, robot, status

Place = tuple[float, float, str]


class Stage:
    """Crowds of the robots that report."""

    def __init__(self) -> None:
        self.fleet, self.live, self.now_s = fleet_of(SITE, Measures()), LiveRobots(), NOW_S
        self.crowds = Crowds(self.live)

    def says(self, places: dict[str, Place], vendor: str = "Mallory", peer: str = "") -> dict[str, bool]:
        """Who comes to a crowd and who leaves one when these robots report, a second later."""
        self.now_s += 1.0
        for name, (x, y, datum) in places.items():
            self.fleet.receive(identity(name, self.now_s, manufacturerName=vendor), self.now_s, Connection(1, peer))
            location = {"x": x, "y": y, "angle": {"x": 0, "y": 0, "z": 0, "w": 1}, "planarDatum": datum}
            self.fleet.receive(status(name, self.now_s, location=location), self.now_s, Connection(1, peer))
        batch = self.fleet.next_batch(self.now_s)
        self.live.update(batch)
        self.live.remove(batch.gone)
        return self.crowds.step(self.now_s)


def heap(n: int, x: float = 0.0, datum: str = HALL, name: str = "M") -> dict[str, Place]:
    return {f"{name}-{i}": (x, 0.1 * (i % 3), datum) for i in range(n)}


def uuids(places: dict[str, Place]) -> set[str]:
    return {robot(name) for name in places}


def test_fewer_than_nine_robots_are_no_crowd() -> None:
    stage = Stage()
    assert stage.says(heap(FEWEST - 1)) == {}
    assert stage.says(heap(FEWEST)) == dict.fromkeys(uuids(heap(FEWEST)), True)
    assert stage.crowds.numbers.keys() == uuids(heap(FEWEST))
    assert stage.says({}) == {}


def test_silent_robots_come_to_no_crowd() -> None:
    stage, robots = Stage(), heap(FEWEST)
    assert stage.says({name: (20.0 * n, 0.0, HALL) for n, name in enumerate(robots)}) == {}
    for name, place in robots.items():
        assert stage.says({name: place}) == {}
        stage.now_s += HEARD_S
    assert stage.says(robots).keys() == uuids(robots)


def test_a_crowd_that_falls_silent_stays_one() -> None:
    stage, robots = Stage(), heap(12)
    assert stage.says(robots).keys() == uuids(robots)
    for _ in range(40):
        assert stage.says({"N": (20.0, 0.0, HALL)}) == {}
    assert stage.crowds.numbers.keys() == uuids(robots)
    assert stage.says({"M-0": (20.0, 0.0, HALL)}) == {}
    stage.now_s += HELD_S
    assert stage.says({"M-0": (20.0, 0.0, HALL)}) == {robot("M-0"): False}


def test_invented_vendors_of_one_source_are_one_crowd() -> None:
    stage = Stage()
    for n, (name, place) in enumerate(heap(12).items()):
        stage.says({name: place}, f"Maker {n}")
    assert stage.crowds.numbers.keys() == uuids(heap(12))
    (crowd,) = stage.crowds.standing()
    assert crowd.label.startswith("several vendors at ")


def test_robots_of_many_sources_are_one_crowd() -> None:
    stage = Stage()
    for n, (name, place) in enumerate(heap(12).items()):
        stage.says({name: place}, f"Maker {n}", f"10.0.0.{n}")
    assert stage.crowds.numbers.keys() == uuids(heap(12))
    (crowd,) = stage.crowds.standing()
    assert crowd.label == "several vendors at several addresses"


@pytest.mark.parametrize(
    ("vendors", "sources", "labels"),
    [
        (3, 3, ["Maker 0", "Maker 1", "Maker 2"]),
        (4, 4, ["several vendors at several addresses"]),
        (4, 1, ["several vendors at 10.0.0.0"]),
    ],
)
def test_the_crowds_of_many_vendors_in_one_heap_are_one(vendors: int, sources: int, labels: list[str]) -> None:
    stage = Stage()
    for vendor in range(vendors):
        stage.says(heap(12, name=f"M{vendor}"), f"Maker {vendor}", f"10.0.0.{vendor % sources}")
    assert [crowd.label for crowd in stage.crowds.standing()] == labels
    assert len(stage.crowds.numbers) == 12 * vendors


def test_a_few_robots_that_come_and_go_do_not_rename_the_crowds_of_a_heap() -> None:
    stage = Stage()
    labels = set[str]()
    for vendors in (4, 3, 4, 2):
        for vendor in range(4):
            there = heap(12, name=f"M{vendor}")
            apart = {name: (100.0 + 10 * number, 0.0, HALL) for number, name in enumerate(there)}
            stage.says(there if vendor < vendors else apart, f"Maker {vendor}", f"10.0.0.{vendor}")
        stage.now_s += HELD_S
        stage.says(heap(12, name="M0"), "Maker 0", "10.0.0.0")
        assert len(stage.crowds.numbers) == 12 * vendors
        labels.update(crowd.label for crowd in stage.crowds.standing())
    assert labels == {"several vendors at several addresses"}


def test_the_first_robots_of_a_crowd_are_found_with_the_others() -> None:
    stage, robots = Stage(), heap(12)
    assert stage.says({"M-0": robots.pop("M-0")}) == {}
    assert stage.says(robots).keys() == uuids(heap(12))


def test_heaps_far_from_each_other_are_no_crowd_unless_one_of_them_is() -> None:
    stage = Stage()
    few = heap(6) | heap(6, 50.0, name="N") | heap(6, 0.0, LOFT, name="O")
    assert stage.says(few) == {}
    assert stage.says(heap(3, 50.0, name="P")).keys() == uuids(heap(6, name="N") | heap(3, name="P"))


def test_a_robot_is_crowded_until_it_has_been_elsewhere_for_a_while() -> None:
    stage = Stage()
    stage.says(heap(12))
    for _ in range(int(HELD_S)):
        assert stage.says({"M-0": (20.0, 0.0, HALL)}) == {}
    assert stage.says({"M-0": (20.0, 0.0, HALL)}) == {robot("M-0"): False}
    assert robot("M-0") not in stage.crowds.numbers
    assert stage.says({"M-0": (0.0, 0.0, HALL)}) == {robot("M-0"): True}


def test_a_robot_that_is_gone_leaves_the_crowd() -> None:
    stage = Stage()
    stage.says(heap(12))
    stage.live.remove([robot("M-3")])
    assert stage.crowds.step(stage.now_s) == {robot("M-3"): False}


def test_a_crowd_is_listed_for_each_vendor_and_floor_at_its_largest_heap() -> None:
    stage = Stage()
    stage.says(heap(10) | heap(15, 30.0, name="N") | heap(9, 60.0, LOFT, name="O"))
    stage.says(heap(11, 0.0, name="K"), "Kestrel")
    crowds = list(stage.crowds.standing())
    found = {(each.label, each.datum, len(each.robots), round(each.x_m), each.y_m < 0.2) for each in crowds}
    assert found == {
        ("Mallory", HALL, 25, 30, True),
        ("Mallory", LOFT, 9, 60, True),
        ("Kestrel", HALL, 11, 0, True),
    }
    numbers = {stage.crowds.numbers[uuid] for uuid in uuids(heap(11, name="K"))}
    assert len(numbers) == 1
    assert numbers.isdisjoint(stage.crowds.numbers[uuid] for uuid in uuids(heap(10)))
    assert all(list(each.robots) == sorted(each.robots) for each in crowds)
