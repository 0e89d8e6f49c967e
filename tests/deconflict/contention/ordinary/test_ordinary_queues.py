"""Queues of one fleet for as long as is usual at the place are counted; all others are published."""

import pytest

from deconflict.contention.ordinary.usual_durations import UsualDurations
from deconflict.engine.engine import Engine
from deconflict.settings.shared_places import Resource
from tests.deconflict.contention.scenes import NOW_S, Scene, Script, raised, resource, site


def dock(service_s: float) -> Resource:
    return resource("d1", 0, 0, service_s=service_s)


def queue(service_s: float, vendor: str = "Alder") -> Scene:
    """A has a dock that it leaves after `service_s`; B comes at 5 s and waits for it."""
    at_dock = Script(
        [(0, 0, 0), (service_s, 0, 0), (service_s + 10, 10, 0)],
        state=lambda t: "waitingInternalEvent" if t < service_s else "navigating",
    )
    waiting = Script([(0, 0, 8), (5, 0, 3), (service_s + 2, 0, 3), (service_s + 5, 0, 0)], [(5, 0, 0)], vendor=vendor)
    return Scene(site(dock(service_s)), {"A": at_dock, "B": waiting})


def counted(scene: Scene) -> tuple[float, float]:
    """Ordinary waits for a place, and their duration in seconds."""
    scene.engine.measures.as_document()
    values = scene.engine.measures.values
    names = "deconflict_ordinary_waits_total", "deconflict_ordinary_wait_seconds_total"
    waits, seconds = (values[name]["contention",] for name in names)
    return waits, seconds


def test_a_short_queue_of_one_fleet_is_counted_and_not_published() -> None:
    scene = queue(25.0)
    assert raised(scene.run(45), "contention") == []
    waits, seconds = counted(scene)
    assert waits == 1
    assert seconds == pytest.approx(20, abs=4)


def test_the_same_queue_of_two_vendors_is_published() -> None:
    scene = queue(25.0, vendor="Corvid")
    assert len(raised(scene.run(45), "contention")) == 1
    assert counted(scene) == (0, 0)


def test_a_long_queue_of_one_fleet_is_published_where_it_is_not_usual() -> None:
    assert len(raised(queue(80.0).run(20), "contention")) == 1


def test_a_long_queue_of_one_fleet_is_ordinary_where_it_is_usual() -> None:
    usual = UsualDurations(30.0)
    for _ in range(50):
        usual.add("d1", 90.0, NOW_S)
    scene = queue(80.0)
    scene.engine = Engine(scene.site, learned={**scene.engine.learned(), "queues_of_fleet": usual.learned()})
    assert raised(scene.run(20), "contention") == []


def test_waits_of_one_fleet_are_learned() -> None:
    scene = queue(25.0)
    scene.run(45)
    learned = scene.engine.learned()["queues_of_fleet"]
    assert learned["places"] == ["d1"]
    assert learned["counts"][1].sum() == 1
