"""Every blockage says what would help, or that a person must look."""

import pytest

from deconflict.settings.shared_places import Resource
from deconflict_client.advisory import Action, AnyAdvisory
from ingest.settings import Model, Trailers, Vendor
from tests.deconflict.contention.scenes import Scene, Script, cleared, raised, resource, site


def scene(state: str, *places: Resource, vendors: tuple[Vendor, ...] = ()) -> Scene:
    """A stands from the start; B of another vendor comes to it after 28 s and waits."""
    blocker = Script([(0, 0, 0)], state=lambda _: state)
    waiting = Script([(0, 0, -30), (28, 0, -1.5)], means=[(0, 0, -30), (60, 0, 30)], vendor="Corvid")
    return Scene(site(*places, vendors=vendors), {"A": blocker, "B": waiting})


def newest(advisories: list[AnyAdvisory]) -> AnyAdvisory:
    (advisory,) = raised(advisories, "blockage")
    return [each for each in advisories if each.id == advisory.id][-1]


def actions(advisory: AnyAdvisory) -> list[tuple[str, str]]:
    assert advisory.recommendation
    return [(action.name, action.action) for action in advisory.recommendation.actions]


def first(advisory: AnyAdvisory) -> Action:
    assert advisory.recommendation
    return advisory.recommendation.actions[0]


@pytest.mark.parametrize(
    ("state", "reason", "task"),
    [
        ("disabled", "disabled", "see what has stopped it, and switch it on again or drive it aside by hand"),
        ("offline", "offline", "switch it on again or push it aside"),
        ("manualOverride", "driven by hand", "have whoever drives it by hand move it aside"),
        ("waitingHumanEvent", "waits for a person", "do what it asks for"),
    ],
)
def test_a_person_should_go_to_a_robot_that_needs_one_and_knows_what_to_do(state: str, reason: str, task: str) -> None:
    advisory = newest(scene(state).run(40))
    assert actions(advisory)[0] == ("Alder A", "look")
    assert (first(advisory).reason, first(advisory).task) == (reason, task)
    assert f"; somebody should go to Alder A ({reason}) and {task}" in advisory.summary


def test_an_idle_robot_should_go_to_the_nearest_free_place_of_its_floor() -> None:
    places = (
        resource("p1", 20, 0, kind="parking", name="Parking 1"),
        resource("p2", -9, 0, kind="parking", name="Bay 2"),
    )
    advisory = newest(scene("idle", *places).run(40))
    assert first(advisory).resource == "p2"
    assert "; Alder A should go to Bay 2" in advisory.summary


def test_an_idle_robot_without_a_free_place_should_go_out_of_the_way() -> None:
    assert "; Alder A should back out of the way" in newest(scene("idle").run(40)).summary


def test_a_person_should_look_at_an_idle_train_without_a_free_place() -> None:
    pulled = Trailers(count=2, length_m=1.0, width_m=0.7, hitch_m=1.3)
    advisory = newest(scene("idle", vendors=(Vendor(name="Alder", models={"A1": Model(trailers=pulled)}),)).run(40))
    assert actions(advisory)[0] == ("Alder A", "look")
    assert first(advisory).reason == "pulls trailers and can't back out"


def test_a_robot_should_drive_around_a_blocker_that_probably_stands_long() -> None:
    advisory = newest(scene("charging").run(40))
    assert actions(advisory) == [("Corvid B", "take_another_route")]
    assert advisory.summary.endswith("in the way of Corvid B; Corvid B should take another route around Alder A")


def test_a_robot_that_stands_without_a_known_reason_should_be_looked_at_after_a_minute() -> None:
    waiting = scene("waitingExternalEvent")
    assert ("Alder A", "look") not in actions(newest(waiting.run(40)))
    assert actions(waiting.run(90, from_s=40)[-1])[0] == ("Alder A", "look")


def test_a_robot_should_wait_for_a_blocker_that_will_soon_move_on() -> None:
    stands = Script([(0, -6, 0), (6, 0, 0)], state=lambda t: "navigating" if t < 6 else "waitingExternalEvent")
    waiting = Script([(0, 0, -7), (6, 0, -1.5)], means=[(0, 0, -7), (60, 0, 53)], vendor="Corvid")
    begun = raised(Scene(site(), {"A": stands, "B": waiting}).run(20), "blockage")[0]
    assert first(begun).action == "wait"
    assert 5 <= (first(begun).seconds or 0) <= 15


def test_a_silent_robot_should_be_looked_at() -> None:
    silent = scene("waitingExternalEvent")
    silent.run(5)
    heard = silent.robots.pop("A")
    assert heard
    advisories = silent.run(60, from_s=5)
    look = first(newest(advisories))
    assert (look.reason, look.task) == ("silent", "see whether it is switched on, and restart it or push it aside")


def test_the_advice_of_a_blockage_changes_only_with_what_should_be_done() -> None:
    blocked = scene("charging")
    advisories = blocked.run(120)
    assert len([advisory for advisory in advisories if advisory.kind == "blockage"]) <= 3
    assert not cleared(advisories, "blockage")
