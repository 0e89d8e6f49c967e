"""People on foot are not warned of each other, and nothing is asked of them: vehicles yield."""

from math import pi

import pytest

from deconflict.advisories.advisory_counts import NEAR_MISSES
from deconflict.engine.engine import Engine
from deconflict.foresight.presence.live_robots import LiveRobots
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.shared_places import Resource, Zone
from deconflict.settings.site import Site
from deconflict_client.advisory import Action, AdvisoryState, AnyAdvisory, BlockageAdvisory
from deconflict_client.participant_kinds import ParticipantKind
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures.measures import Measures
from ingest.settings import Model, Vendor
from tests.deconflict.advice.made_near import until_advised
from tests.deconflict.contention.scenes import Scene, Script, aisle, raised, resource, site
from tests.deconflict.engine.made_engine import LINE, NOW_S, SITE, Floor, eastward, northward
from tests.helpers.saying import identity, robot, status

WALKERS = Vendor(name="Walkers", participant="person", priority=0.1)
"""Their waiting counts least, so that nothing but what they are has vehicles yield."""


def people_at(*places: Resource | Zone) -> Site:
    return site(*places, vendors=(WALKERS,))


def crossing(*people: str) -> Floor:
    """Two that cross each other's way."""
    return Floor(
        {"A": eastward(x=-12.0), "B": northward(y=-12.0)},
        site=SITE.model_copy(update={"vendors": (WALKERS,)}),
        makers=dict.fromkeys(people, "Walkers"),
    )


def test_two_people_on_foot_are_not_warned_of_each_other_and_no_near_miss_is_kept() -> None:
    floor, with_robot = crossing("A", "B"), crossing("B")
    assert with_robot.run(20.0)
    assert sum(with_robot.engine.measures.values[NEAR_MISSES].values()) == 1
    assert not floor.run(20.0)
    assert not sum(floor.engine.measures.values[NEAR_MISSES].values())


def of_one_vendor(**kinds: ParticipantKind) -> Site:
    """The site of one vendor that has devices of several kinds."""
    participants = {kind: tuple(robot(name) for name in kinds if kinds[name] == kind) for kind in kinds.values()}
    return SITE.model_copy(update={"vendors": (Vendor(name="Alder", participants=participants),)})


@pytest.mark.parametrize("other", ["robot", "person", "driven"])
def test_of_one_vendor_a_person_is_warned_of_vehicles_and_not_of_people(other: ParticipantKind) -> None:
    courses = {"A": eastward(x=-12.0), "B": northward(y=-12.0)}
    advisories = Floor(courses, site=of_one_vendor(A="person", B=other)).run(20.0)
    assert bool(advisories) is (other != "person")
    assert all(set(each.participants) == {"person", other} for each in advisories)


def test_a_reload_that_makes_people_of_two_robots_ends_their_warning_and_back_begins_it() -> None:
    floor = Floor({"A": eastward(x=-12.0), "B": northward(y=-12.0)})
    (warned,) = {each.id for each in floor.run(6.0)}

    def reload(site: Site) -> None:
        frames = FrameRegistry(site.datums, site.vendors)
        floor.fleet.reconfigure(VendorRegistry(site.vendors), frames, site.reading)
        floor.engine = floor.engine.renewed(site)
        floor.engine.receive(floor.fleet.snapshot(NOW_S + 6.0))

    reload(of_one_vendor(A="person", B="person"))
    last = floor.run(8.0, 6.0)[-1]
    assert (last.id, last.state) == (warned, AdvisoryState.CLEARED)
    reload(of_one_vendor(A="person"))
    again = floor.run(10.0, 8.0)[-1]
    assert again.participants[again.robots.index(robot("A"))] == "person"


def test_who_turns_out_to_be_a_robot_by_its_model_is_one_from_then_on() -> None:
    truck = Vendor(name="Alder", participant="person", robots=(robot("A"),), models={"A1": Model(participant="robot")})
    fleet, live = fleet_of(SITE.model_copy(update={"vendors": (truck,)}), Measures()), LiveRobots()
    fleet.receive(status("A", NOW_S), NOW_S, LINE)
    live.update(fleet.next_batch(NOW_S))
    assert live.on_foot == {robot("A")}
    fleet.receive(identity("A", NOW_S + 1), NOW_S + 1, LINE)
    live.update(fleet.next_batch(NOW_S + 1))
    assert not live.on_foot


def test_who_is_small_and_slow_and_says_no_path_is_no_person_and_keeps_all_warnings() -> None:
    """Nothing but the site file makes a person, since two people are not warned of each other."""
    fleet, engine, found = fleet_of(SITE, Measures()), Engine(SITE), list[AnyAdvisory]()
    for second in range(12):
        for name, x_m, y_m, yaw_rad in (("A", second - 10.0, 0.0, 0.0), ("B", 0.0, second - 10.0, pi / 2)):
            if not second:
                small = identity(name, NOW_S, baseRobotEnvelope={"x": 0.6, "y": 0.6, "z": 1.8})
                fleet.receive(small, NOW_S, LINE)
            report = status(name, NOW_S + second, x_m, y_m, yaw_rad, velocity={"linear": 1.0})
            assert fleet.receive(report, NOW_S + second, LINE) is None
        engine.receive(fleet.next_batch(NOW_S + second))
        found += [each for quarter in range(4) for each in engine.step(NOW_S + second + quarter / 4)]
    assert {each.participants for each in found} == {("robot", "robot")}


@pytest.mark.parametrize("vendor", ["Alder", "Walkers"])
def test_what_is_of_people_on_foot_alone_is_no_finding(vendor: str) -> None:
    robots = {
        "A": Script([(0, -0.6, 0)], state=lambda _: "idle", vendor="Walkers"),
        "B": Script([(0, 0.6, 0.6)], state=lambda _: "idle", vendor=vendor),
    }
    found = raised(Scene(people_at(resource("d1", 0, 0)), robots).run(5), "double_occupancy")
    assert bool(found) is (vendor == "Alder")


@pytest.mark.parametrize("person", ["A", "B"])
def test_of_a_person_and_a_robot_that_cross_the_robot_waits(person: str) -> None:
    advisory, _ = until_advised(crossing(person))
    assert advisory.recommendation
    assert {hold.robot for hold in advisory.recommendation.holds} == {robot("B" if person == "A" else "A")}


def test_in_a_lane_the_robot_backs_out_for_the_person() -> None:
    """The person is less far in: of two robots it would be the one to back out."""
    robots = {
        "A": Script([(0, -16, 0), (40, 24, 0)], vendor="Walkers"),
        "B": Script([(0, 16, 0), (40, -24, 0)]),
    }
    scene = Scene(people_at(aisle("lane", -8, 12)), robots)
    (advisory,) = raised(scene.run(8), "deadlock")
    last = [each for each in scene.run(12, from_s=8) if each.id == advisory.id][-1]
    assert last.recommendation
    assert asked(last.recommendation.actions) <= {robot("B")}
    assert max(last.recommendation.slots, key=lambda slot: slot.wait_s).robot == robot("B")


def test_a_person_is_not_asked_to_wait_for_a_robot_that_stands_in_the_way() -> None:
    stands = Script([(0, 0, 0)], state=lambda _: "waitingExternalEvent")
    walks = Script([(0, -20, 0), (40, 20, 0)], vendor="Walkers")
    advisories = Scene(people_at(), {"A": stands, "C": walks}).run(16)
    found = [each for each in advisories if isinstance(each, BlockageAdvisory)]
    assert found, "the person is warned as before"
    assert not [action for each in found if each.recommendation for action in each.recommendation.actions]


def asked(actions: tuple[Action, ...]) -> set[str]:
    return {action.robot for action in actions if action.action != "go_first"}
