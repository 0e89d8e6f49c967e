"""What the engine tells of robots that have fallen silent."""

from collections.abc import Mapping

import pytest

from deconflict.cluster.judging.global_judge import GlobalJudge
from deconflict.engine.engine import Engine
from deconflict.foresight.presence.probably_left import PresenceChanges
from deconflict.runtime.learned_state import Part, learned_of
from deconflict.settings.site import Conflict, Site
from deconflict_client.advisory import AdvisoryState, AnyAdvisory, ConflictAdvisory
from ingest.batch import Batch
from ingest.measures.measures import Measures
from tests.deconflict.foresight.presence.made_watch import DATUMS, DOOR_M, NOW_S, Watch, leave
from tests.helpers.saying import points, robot

SITE = Site(name="Test floor", datums=DATUMS, conflict=Conflict(clearance_m=0.3, confirm=(2, 3)))
SIZE = {"x": 1.0, "y": 0.6, "z": 0.4}


class Judged(Watch):
    """The same floor, judged by an engine."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.engine = Engine(SITE, learned=Engine(SITE).learned() | self.learned if self.learned else None)
        self.live, self.presence, self.measures = self.engine.live, self.engine.presence, self.engine.measures
        self.advisories: list[AnyAdvisory] = []

    def take(self, batch: Batch) -> None:
        self.engine.receive(batch)

    def tick(self, everything: bool = False) -> PresenceChanges:
        self.take(self.fleet.next_batch(NOW_S + self.now_s, everything))
        self.advisories += self.engine.step(NOW_S + self.now_s)
        return PresenceChanges()

    def conflicts(self, state: AdvisoryState | None = None) -> list[ConflictAdvisory]:
        return [
            advisory
            for advisory in self.advisories
            if isinstance(advisory, ConflictAdvisory) and state in (None, advisory.state)
        ]

    def blockages(self) -> list[AnyAdvisory]:
        return [advisory for advisory in self.advisories if advisory.kind == "blockage"]


@pytest.fixture(scope="module")
def door() -> Mapping[str, Part]:
    """Robots leave at the door."""
    watch = Watch()
    leave(watch, 12)
    watch.wait(60.0)
    return learned_of(watch.presence.learners)


def at_the_door(learned: Mapping[str, Part] | None) -> Judged:
    """A robot drives up to the door and is not heard again; another one follows ten seconds later."""
    floor = Judged(learned=dict(learned) if learned else None)
    for name in ("first", "second"):
        floor.identify(name, baseRobotEnvelope=SIZE)
    arrive(floor)
    floor.wait(10.0)
    floor.drive("second", DOOR_M - 12.0, 0.2, seconds=8)
    return floor


def arrive(floor: Watch) -> None:
    for second in range(8):
        floor.say("first", DOOR_M - 8.0 + second, 0.2, 1.0, path_s=8 - second)
        floor.tick()
        floor.wait(1.0)
    floor.say("first", DOOR_M, 0.2, operationalState="idle")
    floor.tick()


def test_a_robot_that_has_left_by_an_exit_has_no_conflicts(door: Mapping[str, Part]) -> None:
    assert at_the_door(None).conflicts(AdvisoryState.RAISED) != []
    floor = at_the_door(door)
    assert floor.conflicts(AdvisoryState.RAISED) == []
    assert floor.presence.silences.has_probably_left(robot("first"))


def test_a_robot_that_has_probably_left_is_still_an_obstacle(door: Mapping[str, Part]) -> None:
    floor = at_the_door(door)
    assert robot("first") in floor.engine.live.robots
    robots, _ = floor.engine._sweep.sweeper.copied([robot("first")])
    assert robots["count"].tolist() == [1]


def test_a_silent_robot_is_removed_once_another_has_driven_through_its_place(door: Mapping[str, Part]) -> None:
    floor = at_the_door(None)
    (raised,) = floor.conflicts(AdvisoryState.RAISED)
    floor.drive("second", DOOR_M - 3.0, 0.2, seconds=4)
    (cleared,) = floor.conflicts(AdvisoryState.CLEARED)
    assert cleared.id == raised.id
    assert cleared.cleared_because == "Alder first is not there: Alder second has driven through its place"
    robots, _ = floor.engine._sweep.sweeper.copied([robot("first")])
    assert robots["count"].tolist() == [0]
    assert floor.engine.probabilities() == []
    floor.wait(60.0)
    floor.say("first", 0.0)
    floor.tick()
    assert robot("first") in floor.engine.live.robots


def test_a_robot_keeps_its_slot_until_no_part_knows_it(door: Mapping[str, Part]) -> None:
    """Contention forgets those that have probably left, and all but presence those that were driven through."""
    floor, first = at_the_door(door), robot("first")
    slots, contention = floor.live.slots, floor.engine._shared.contention.robots
    slot = slots.by_uuid[first]
    assert first in floor.live.robots
    assert first not in contention
    floor.drive("second", DOOR_M - 3.0, 0.2, seconds=4)
    assert first not in floor.live.robots
    assert floor.engine.foresight.robots.slot_of(first) is None
    floor.say("first", 0.0)
    floor.tick()
    known = contention.slots, floor.engine.foresight.robots.slots, floor.engine._sweep.sweeper.slots
    assert all(each is slots for each in known)
    assert slots.by_uuid[first] == slot == floor.live.robots[first].slot
    assert floor.presence._intervals.moved(first)
    assert first in contention
    floor.wait(SITE.reading.forget_after_s + 60.0)
    assert (slots.by_uuid, slots.uuids) == ({}, ["", ""])
    floor.say("third", 3.0)
    floor.tick()
    assert floor.live.robots[robot("third")].slot in (0, 1)
    assert floor.presence._intervals.moved(robot("third")) is None


def followed(beside_m: float, path_s: int) -> tuple[Judged, dict[str, float]]:
    """One drives up to the door, tells so much of its way and is not heard again; another follows it. What became of
    their pair."""
    floor = Judged()
    for name in ("first", "second"):
        floor.identify(name, baseRobotEnvelope=SIZE)
    for second in range(16):
        if second < 8:
            floor.say("first", DOOR_M - 4.0 + second / 2, 0.2, 0.5, path_s=path_s)
        floor.say("second", DOOR_M - 13.5 + second, beside_m, 1.0)
        floor.tick()
        floor.wait(1.0)
    floor.wait(20.0)
    values = floor.measures.values["deconflict_probability_outcomes_total"]
    return floor, {outcome: count for (outcome,), count in values.items()}


def test_a_pair_was_kept_apart_where_one_was_silent_and_driven_through_and_is_unknown_otherwise() -> None:
    _, unknown = followed(1.2, path_s=1)
    assert unknown["passed"] == 0
    # where its path ends, and where it was heard last
    for path_s, is_off in ((1, True), (10, False)):
        floor, known = followed(0.2, path_s)
        assert (robot("first") in floor.presence.removed.robots) == is_off
        assert known["passed"] > 0
        assert known["left"] < unknown["left"]


def test_an_advisory_on_a_silent_robot_says_so() -> None:
    floor = Judged()
    for name in ("silent", "other"):
        floor.identify(name, baseRobotEnvelope=SIZE)
    floor.stand("silent", 20.0)
    floor.wait(30.0)
    floor.drive("other", 8.0, seconds=6)
    (raised,) = floor.conflicts(AdvisoryState.RAISED)
    assert "Alder other reaches Alder silent, silent for 3" in raised.summary
    assert dict(zip(raised.names, raised.basis, strict=True))["Alder silent"] == "stationary (silent)"


def test_an_advisory_says_so_as_soon_as_its_robot_falls_silent() -> None:
    floor = Judged()
    for name in ("silent", "other"):
        floor.identify(name, baseRobotEnvelope=SIZE)
    for second in range(14):
        floor.say("other", 6.0 + second * 0.5, speed_mps=0.5)
        if second < 6:
            floor.say("silent", 14.0, operationalState="idle")
        floor.tick()
        floor.wait(1.0)
    first, *others = floor.conflicts()
    assert "silent for" not in first.summary
    (advisory,) = [other for other in others if other.summary.count("Alder silent, silent for 5 s,")][:1]
    assert advisory.state is AdvisoryState.UPDATED
    assert len({conflict.id for conflict in floor.conflicts()}) == 1


def test_a_silent_robot_that_stood_with_a_path_is_taken_to_stand_there() -> None:
    floor = Judged()
    for name in ("waits", "other"):
        floor.identify(name, baseRobotEnvelope=SIZE)
    for _ in range(4):
        at_s = NOW_S + floor.now_s
        floor.say("waits", 20.0, path=points((at_s + 8, 20.0, 0.0, 0.0), (at_s + 10, 22.0, 5.0, 0.0)))
        floor.tick()
        floor.wait(1.0)
    floor.wait(20.0)
    floor.drive("other", 10.0, seconds=5)
    assert floor.conflicts(AdvisoryState.RAISED) != []
    assert floor.engine.live.robots[robot("waits")].forecast.x_m.tolist() == [20.0]


def two_at_the_door() -> Judged:
    """Two robots drive to the door from both sides, and are not heard again."""
    floor = Judged()
    for name in ("first", "second", "other"):
        floor.identify(name, baseRobotEnvelope=SIZE)
    for second in range(6):
        floor.say("first", DOOR_M - 8.0 + second, 0.2, 1.0, path_s=8 - second)
        floor.say("second", DOOR_M - 8.0 + second, 6.2 - second, 1.0, path_s=8 - second)
        floor.tick()
        floor.wait(1.0)
    return floor


def watched_pairs(floor: Judged) -> list[tuple[str, str]]:
    pairs, robots = floor.engine.foresight.pairs, floor.engine.foresight.robots
    return robots.pair_names(pairs["code"][pairs["watched"]])


def test_two_silent_robots_whose_forecasts_have_ended_are_no_pair_any_more() -> None:
    floor = two_at_the_door()
    assert watched_pairs(floor) != []
    floor.wait(60.0)
    assert watched_pairs(floor) == []
    assert len(floor.engine._conflicts.pairs) == 0
    assert floor.engine.open() == []


def test_a_dormant_robot_that_reports_is_swept_again_and_grows_again() -> None:
    floor = two_at_the_door()
    for _ in range(2):
        floor.wait(70.0)
        assert floor.engine._sweep.dormant == {robot("first"), robot("second")}
        assert floor.engine.live.robots[robot("first")].growth_m == pytest.approx(1.0)
        floor.stand("first", DOOR_M)
        assert floor.engine._sweep.dormant == {robot("second")}
        assert floor.engine.live.robots[robot("first")].growth_m == 0.0


def test_a_robot_that_drives_towards_a_dormant_one_is_warned() -> None:
    floor = Judged()
    for name in ("silent", "other"):
        floor.identify(name, baseRobotEnvelope=SIZE)
    floor.stand("silent", 20.0)
    floor.wait(100.0)
    assert floor.engine._sweep.dormant == {robot("silent")}
    floor.drive("other", 8.0, seconds=6)
    assert len(floor.conflicts(AdvisoryState.RAISED)) == 1


def blocked(floor: Watch) -> None:
    """A robot drives up to the door and is not heard again; another one waits behind, with a path through its place."""
    for name in ("first", "second"):
        floor.identify(name, baseRobotEnvelope=SIZE)
    arrive(floor)
    for _ in range(40):
        floor.say("second", DOOR_M - 3.0, 0.2, 0.5)
        floor.tick()
        floor.wait(1.0)


def test_a_robot_that_has_left_blocks_nobody(door: Mapping[str, Part]) -> None:
    floor = Judged()
    blocked(floor)
    assert floor.blockages() != []
    floor = Judged(learned=dict(door))
    blocked(floor)
    assert floor.blockages() == []


class Watched(Watch):
    """The same floor, watched by what several machines have for all of it."""

    def __post_init__(self) -> None:
        super().__post_init__()
        empty = GlobalJudge(SITE).learned()
        self.judge = GlobalJudge(SITE, learned=empty | self.learned if self.learned else None)
        self.advisories: list[AnyAdvisory] = []

    def tick(self, everything: bool = False) -> PresenceChanges:
        self.judge.receive([self.fleet.next_batch(NOW_S + self.now_s, everything)])
        self.advisories += self.judge.advance(NOW_S + self.now_s)
        return PresenceChanges()


def test_the_global_judge_of_a_cluster_knows_which_robots_have_left(door: Mapping[str, Part]) -> None:
    for learned, is_told in ((None, True), (dict(door), False)):
        floor = Watched(learned=learned)
        blocked(floor)
        assert any(advisory.kind == "blockage" for advisory in floor.advisories) == is_told


def test_metrics_count_how_silences_ended_and_which_robots_have_probably_left(door: Mapping[str, Part]) -> None:
    floor = at_the_door(door)
    measures: Measures = floor.engine.measures
    assert measures.as_document()["values"]["deconflict_robots_probably_left"] == [[["Alder"], 1]]
    floor.drive("second", DOOR_M - 3.0, 0.2, seconds=4)
    values = measures.as_document()["values"]
    assert values["deconflict_robots_probably_left"] == [[["Alder"], 0]]
    assert values["deconflict_silences_total"] == [[["Alder", "driven_through"], 1]]


def test_a_warning_ends_before_the_grace_time_when_one_goes_out_over_the_edge() -> None:
    floor = Judged()
    leave(floor, 3)
    for name in ("first", "second"):
        floor.identify(name, baseRobotEnvelope=SIZE)
    for second in range(10):
        if second <= 6:
            floor.say("first", DOOR_M - 6.0 + second, 0.2, 1.0, path_s=2)
        floor.say("second", DOOR_M - 9.0 + second, 0.2, 1.0)
        floor.tick()
        floor.wait(1.0)
    raised, *_, cleared = floor.conflicts()
    silent_s = cleared.updated_at.timestamp() - (NOW_S + floor.now_s - 4.0)
    assert (raised.state, cleared.state) == (AdvisoryState.RAISED, AdvisoryState.CLEARED)
    assert (cleared.cleared_because or "").endswith("is silent and has probably left")
    assert 3.0 <= silent_s < 4.0


def test_heard_ground_and_seen_ground_are_two_parts_and_an_older_state_has_only_one() -> None:
    floor = Judged()
    leave(floor, 1)
    learned = floor.engine.learned()
    assert {"ground", "heard_ground"} <= learned.keys()
    older = {name: part for name, part in learned.items() if name != "heard_ground"}
    assert not Engine(SITE, learned=learned).set_aside
    assert not Engine(SITE, learned=older).set_aside
    judge = GlobalJudge(SITE).learned()
    assert not GlobalJudge(SITE, learned={name: judge[name] for name in judge if name != "heard_ground"}).set_aside
