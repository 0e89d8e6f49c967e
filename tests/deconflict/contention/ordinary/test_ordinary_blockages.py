"""Blockages that are a fleet's own order are counted; published are those that hold up another vendor, or last long."""

import pytest

from deconflict.settings.shared_places import ContentionSettings
from deconflict_client.advisory import AnyAdvisory
from tests.deconflict.contention.scenes import Scene, Script, after_s, cleared, raised, site


def waits(*_: float) -> str:
    return "waitingExternalEvent"


def stops(stands_s: float, vendor: str = "Alder", state: str = "waitingExternalEvent") -> Script:
    """A robot that comes from the west, stands at (0, 0) from 5 s on, and goes on to the east."""
    knots = [(0, -5, 0), (5, 0, 0), (5 + stands_s, 0, 0), (25 + stands_s, 20, 0)]
    return Script(knots, vendor=vendor, state=lambda t: state if 5 <= t < 5 + stands_s else "navigating")


def held_up(stands_s: float, vendor: str = "Alder", from_s: float = 6) -> Script:
    """A robot that comes from the south, and waits 1.5 m before (0, 0) until the other has gone."""
    knots = [(0, 0, -8), (from_s, 0, -1.5), (5 + stands_s + 2, 0, -1.5), (25 + stands_s, 0, 16)]
    return Script(knots, vendor=vendor, means=[(0, 0, -8), (40, 0, 32)])


def published(blocker: Script, *others: Script, until_s: float, **settings: float) -> list[AnyAdvisory]:
    return raised(scene(blocker, *others, **settings).run(until_s), "blockage")


def scene(blocker: Script, *others: Script, **settings: float) -> Scene:
    robots = dict(zip("ABCD", (blocker, *others), strict=False))
    return Scene(site(contention=ContentionSettings(**settings)), robots)


def counted(scene: Scene) -> tuple[float, float]:
    """Ordinary waits for a blocker, and their duration in seconds."""
    scene.engine.measures.as_document()
    values = scene.engine.measures.values
    names = "deconflict_ordinary_waits_total", "deconflict_ordinary_wait_seconds_total"
    waits, seconds = (values[name]["blockage",] for name in names)
    return waits, seconds


def test_a_fleet_that_waits_for_itself_is_counted_and_not_published() -> None:
    fleet = scene(stops(20), held_up(20))
    assert raised(fleet.run(45), "blockage") == []
    waits, seconds = counted(fleet)
    assert waits == 1
    assert seconds == pytest.approx(19, abs=3)


def test_a_robot_that_holds_up_another_vendor_is_published_before_ten_seconds_are_lost() -> None:
    blocked = scene(stops(20), held_up(20, "Corvid"))
    (advisory,) = raised(blocked.run(45), "blockage")
    assert after_s(advisory) < 16
    assert counted(blocked) == (0, 0)


def test_a_short_stop_before_another_vendor_is_not_published() -> None:
    assert published(stops(6), held_up(6, "Corvid", from_s=10), until_s=30) == []


def test_a_fleet_held_up_for_longer_than_it_may_is_published() -> None:
    (advisory,) = published(stops(60), held_up(60), until_s=60)
    assert after_s(advisory) == pytest.approx(5 + 30, abs=3)


def test_the_site_says_how_long_a_fleet_may_hold_itself_up() -> None:
    (advisory,) = published(stops(60), held_up(60), until_s=60, fleet_wait_s=15.0)
    assert after_s(advisory) == pytest.approx(5 + 15, abs=3)


@pytest.mark.parametrize("state", ["disabled", "offline", "manualOverride"])
def test_a_robot_that_a_person_has_to_move_is_never_ordinary(state: str) -> None:
    (advisory,) = published(stops(60, state=state), held_up(60), until_s=60)
    assert after_s(advisory) < 16


def test_a_published_blockage_stays_open_while_it_stands() -> None:
    blocked = scene(stops(60), held_up(60))
    advisories = blocked.run(75)
    (advisory,), (end,) = raised(advisories, "blockage"), cleared(advisories, "blockage")
    assert end.id == advisory.id
    assert (end.updated_at - advisory.raised_at).total_seconds() > 25


def test_long_stands_become_usual_where_a_fleet_often_stands_long() -> None:
    stands, waits_for = ((0, -5), (5, 0), (65, 0), (80, 20)), ((0, -8), (6, -1.5), (67, -1.5), (85, 16))
    knots = [(90.0 * n + t, float(x), 0.0) for n in range(20) for t, x in stands]
    blocker = Script(knots, state=lambda t: "waitingExternalEvent" if 5 <= t % 90 < 65 else "navigating")
    waiter = Script(
        [(90.0 * n + t, 0.0, float(y)) for n in range(20) for t, y in waits_for],
        means=[(90.0 * n + t, 0.0, y) for n in range(20) for t, y in ((0, -8.0), (85, 77.0))],
    )
    times_s = [after_s(advisory) for advisory in published(blocker, waiter, until_s=1800)]
    assert any(at_s < 180 for at_s in times_s)
    assert not any(at_s > 1350 for at_s in times_s)
