"""A robot through whose place another one has driven is not there."""

from typing import Any

import pytest

from deconflict.runtime.learned_state import learned_of, packed, unpacked
from tests.deconflict.foresight.presence.made_watch import LINE, NOW_S, Watch
from tests.helpers.saying import LOFT, identity, robot

SIZE = {"x": 1.0, "y": 0.6, "z": 0.4}


def with_silent(silent_s: float = 20.0, **fields: Any) -> Watch:
    """A robot stands at 10, 0, and falls silent."""
    watch = Watch()
    for name in ("silent", "other"):
        watch.identify(name, baseRobotEnvelope=SIZE)
    watch.stand("silent", 10.0, **fields)
    watch.wait(silent_s)
    return watch


def is_off(watch: Watch) -> bool:
    off = robot("silent") in watch.gone
    assert off == (robot("silent") not in watch.live.robots) == (robot("silent") in watch.presence.removed.robots)
    return off


def test_a_robot_that_drives_through_the_place_shows_that_it_is_empty() -> None:
    watch = with_silent()
    watch.drive("other", 5.0, 0.1, seconds=3)
    assert not is_off(watch)
    watch.drive("other", 9.0, 0.1, seconds=4)
    assert is_off(watch)
    off = watch.presence.removed.robots.get(robot("silent"))
    assert off is not None
    assert off.by == "Alder other"
    assert watch.outcomes() == {"driven_through": 1}


@pytest.mark.parametrize(
    ("beside_m", "off"),
    [(0.0, True), (0.25, True), (0.35, False), (0.55, False), (0.9, False)],
)
def test_a_mere_touch_shows_nothing(beside_m: float, off: bool) -> None:
    """Both are 0.6 m wide: they touch at 0.6 m, and their inner halves at 0.3 m."""
    watch = with_silent()
    watch.drive("other", 5.0, beside_m, seconds=10)
    assert is_off(watch) == off


def test_the_way_between_two_reports_must_lead_through_the_place() -> None:
    watch = with_silent()
    watch.drive("other", 8.7, 0.0, 2.8, seconds=1)
    assert is_off(watch)


def test_of_an_unknown_way_only_the_end_counts() -> None:
    watch = with_silent()
    watch.say("other", 5.0)
    watch.tick()
    watch.wait(4.0)
    watch.say("other", 15.0)
    watch.tick()
    assert not is_off(watch)
    watch.wait(4.0)
    watch.say("other", 10.2)
    watch.tick()
    assert is_off(watch)


def test_no_robot_is_removed_within_its_grace_time_or_while_it_is_heard() -> None:
    watch = with_silent(4.0)
    watch.say("other", 9.5)
    watch.tick()
    watch.wait(0.5)
    watch.say("other", 10.5)
    watch.tick()
    assert not is_off(watch)


def test_a_robot_that_stands_in_the_place_already_drives_through_nothing() -> None:
    watch = with_silent(4.0)
    watch.stand("other", 10.0, seconds=30)
    assert not is_off(watch)


def test_other_heights_other_floors_and_uncertain_places_show_nothing() -> None:
    above = Watch()
    for name in ("silent", "other"):
        above.identify(name, baseRobotEnvelope=SIZE)
    above.stand("silent", 10.0, place={"z": 3.0})
    above.wait(20.0)
    above.drive("other", 5.0, seconds=10)
    assert not is_off(above)
    elsewhere = with_silent()
    elsewhere.drive("other", 5.0, seconds=10, datum=LOFT)
    assert not is_off(elsewhere)
    lost = with_silent()
    lost.drive("other", 5.0, seconds=10, errorCodes=["localizationLost"])
    assert not is_off(lost)


def test_a_robot_that_was_to_drive_on_has_its_place_where_its_path_ends() -> None:
    watch = Watch()
    for name in ("silent", "other"):
        watch.identify(name, baseRobotEnvelope=SIZE)
    watch.drive("silent", 0.0, seconds=5)
    watch.wait(20.0)
    watch.drive("other", 5.0, -5.0, seconds=4)
    watch.drive("other", 4.0, 0.0, seconds=4)
    assert not is_off(watch)
    watch.drive("other", 12.0, 0.0, seconds=6)
    assert is_off(watch)


def test_if_the_end_of_its_path_is_empty_a_robot_is_believed_to_stand_where_it_was_last_heard() -> None:
    watch = Watch()
    for name in ("silent", "other"):
        watch.identify(name, baseRobotEnvelope=SIZE)
    watch.drive("silent", 0.0, seconds=5)
    watch.wait(20.0)
    watch.drive("other", 12.0, seconds=6)
    assert not is_off(watch)
    assert [name for changes in watch.changes for name in changes.stopped] == [robot("silent")]
    watch.wait(30.0)
    watch.drive("other", 13.0, seconds=4)
    assert not is_off(watch)
    watch.drive("other", 3.0, seconds=4)
    assert is_off(watch)
    assert watch.outcomes()["driven_through"] == 1


def test_a_charging_robot_is_removed_too() -> None:
    watch = with_silent(operationalState="charging")
    assert watch.there("silent") == 1.0
    watch.drive("other", 5.0, seconds=10)
    assert is_off(watch)


def test_a_removed_robot_returns_when_it_reports_and_counts_as_found_elsewhere() -> None:
    watch = with_silent()
    watch.drive("other", 5.0, seconds=10)
    watch.tick(everything=True)
    assert robot("silent") not in watch.live.robots  # only told again
    watch.say("silent", 30.0)
    watch.tick()
    assert robot("silent") in watch.live.robots
    assert robot("silent") not in watch.presence.removed.robots
    assert watch.outcomes() == {"driven_through": 1, "elsewhere": 1}
    watch.wait(6.0)
    assert watch.presence.silent_s(robot("silent"), NOW_S + watch.now_s) is not None


def test_a_removed_robot_stays_removed_over_a_restart() -> None:
    watch = with_silent()
    watch.drive("other", 5.0, seconds=10)
    after = Watch(learned=unpacked(packed(learned_of(watch.presence.learners))))
    after.fleet, after.now_s = watch.fleet, watch.now_s + 1.0
    after.tick(everything=True)
    assert robot("other") in after.live.robots
    assert robot("silent") not in after.live.robots
    after.say("silent", 10.0)
    after.tick()
    assert robot("silent") in after.live.robots


@pytest.mark.parametrize(("length_m", "removed"), [(0.6, False), (2.0, True)])
def test_the_place_of_a_silent_robot_has_the_size_that_becomes_known_later(length_m: float, removed: bool) -> None:
    watch = with_silent()
    watch.identify("silent", baseRobotEnvelope={"x": length_m, "y": 0.8 * length_m, "z": 0.4})
    watch.tick()
    watch.wait(60.0)
    watch.drive("other", 5.0, 0.45, seconds=9)
    assert is_off(watch) == removed


def test_a_later_identity_report_does_not_bring_a_removed_robot_back() -> None:
    watch = with_silent()
    watch.drive("other", 5.0, seconds=10)
    watch.fleet.receive(identity("silent", NOW_S + watch.now_s), NOW_S + watch.now_s, LINE)
    watch.tick()
    assert robot("silent") not in watch.live.robots


def test_where_robots_are_driven_through_again_and_again_is_an_exit() -> None:
    watch = Watch()
    watch.identify("other", baseRobotEnvelope=SIZE)
    for number in range(5):
        watch.identify(f"R{number}", baseRobotEnvelope=SIZE)
        watch.drive(f"R{number}", 5.0, seconds=5, path_s=1)
        watch.wait(8.0)
        watch.drive("other", 8.0, seconds=6)
        watch.wait(5.0)
    assert watch.outcomes()["driven_through"] == 5
    (exit_,) = watch.presence.exits(NOW_S + watch.now_s)
    assert exit_.robots == 5
    assert exit_.x_m == pytest.approx(10.0, abs=0.1)
