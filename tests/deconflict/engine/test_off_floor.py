"""What the engine tells of robots that a person takes off the floor, or that are moved by hand."""

from collections.abc import Iterator
from typing import Any

import pytest

from deconflict.cluster.judging.global_judge import GlobalJudge
from deconflict.engine.engine import Engine
from deconflict.foresight.presence.probably_left import PresenceChanges
from deconflict.settings.site import Conflict, Site
from deconflict_client.advisory import AdvisoryState, AnyAdvisory, ClearedCode
from ingest.batch import Batch
from ingest.recording.operator_events import OffFloorMark
from tests.deconflict.foresight.presence.made_watch import DATUMS, NOW_S, Watch
from tests.helpers.saying import HALL, robot

SITE = Site(name="Test floor", datums=DATUMS, conflict=Conflict(clearance_m=0.3, confirm=(2, 3)))
SIZE = {"x": 1.0, "y": 0.6, "z": 0.4}
IDLE: dict[str, Any] = {"operationalState": "idle", "velocity": {"linear": 0.0}}


class Aisle(Watch):
    """A robot stands in an aisle, and others drive there. An engine and a global judge hear all."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.engine, self.judge = Engine(SITE), GlobalJudge(SITE)
        self.live, self.presence, self.measures = self.engine.live, self.engine.presence, self.engine.measures
        self.advisories: list[AnyAdvisory] = []
        self.judged: list[AnyAdvisory] = []
        for name in ("stands", "first", "second", "asleep"):
            self.identify(name, baseRobotEnvelope=SIZE, maxSpeed=2.0)

    def take(self, batch: Batch) -> None:
        batch = Batch.from_bytes(batch.to_bytes())
        self.engine.receive(batch)
        self.judge.receive([batch])

    def tick(self, everything: bool = False) -> PresenceChanges:
        self.take(self.fleet.next_batch(NOW_S + self.now_s, everything))
        self.advisories += self.engine.step(NOW_S + self.now_s)
        self.judged += self.judge.advance(NOW_S + self.now_s)
        return PresenceChanges()

    def of(self, kind: str, state: AdvisoryState) -> list[AnyAdvisory]:
        return [each for each in self.advisories if each.kind == kind and each.state is state]

    def mark(self, *, is_off: bool, x_m: float = 12.0) -> None:
        at_s = NOW_S + self.now_s
        self.fleet.off_floor.note(OffFloorMark(robot("stands"), at_s, is_off, "Petra", HALL, x_m))

    def seconds(self, count: int) -> Iterator[None]:
        for _ in range(count):
            yield
            self.tick()
            self.wait(1.0)


def met() -> Aisle:
    """A robot stands in the way of one that drives, and of one that has waited behind it for long."""
    floor = Aisle()
    for second, _ in enumerate(floor.seconds(20)):
        floor.say("stands", 12.0, **IDLE)
        floor.say("first", min(-9.0 + second, 9.0), 0.0, 1.0, velocity={"linear": 1.0 if second < 18 else 0.0})
    return floor


@pytest.fixture
def floor() -> Aisle:
    return met()


def test_a_robot_off_the_floor_ends_what_it_is_a_party_of_at_once(floor: Aisle) -> None:
    assert [each.kind for each in floor.engine.open()] == ["conflict"]
    floor.mark(is_off=True)
    floor.tick()
    assert floor.engine.open() == []
    (cleared,) = floor.of("conflict", AdvisoryState.CLEARED)
    assert cleared.cleared_code is ClearedCode.OFF_FLOOR
    assert cleared.cleared_because == "Alder stands is off the floor, as an operator says"
    assert floor.engine.probabilities() == []
    for _ in floor.seconds(4):
        floor.say("stands", 12.0, **IDLE)
        floor.say("first", 9.0, 0.0, 1.0)
    assert robot("stands") not in floor.engine.live.robots
    assert robot("stands") not in floor.judge._live.robots
    assert floor.engine.open() == []


@pytest.mark.parametrize("is_driven", [True, False], ids=["it drives", "taken back"])
def test_a_robot_that_is_back_is_judged_at_once(floor: Aisle, is_driven: bool) -> None:
    floor.mark(is_off=True)
    floor.wait(2.0)
    for second, _ in enumerate(floor.seconds(5)):
        if is_driven:
            floor.say("stands", 16.0 - second, 0.0, -1.0, velocity={"linear": -1.0})
        elif not second:
            floor.mark(is_off=False)
        floor.say("first", 8.0, 0.0, 1.0)
    assert robot("stands") in floor.engine.live.robots
    assert [each.state for each in floor.of("conflict", AdvisoryState.RAISED)] != []
    assert [each.kind for each in floor.engine.open()] == ["conflict"]


def test_findings_with_a_robot_off_the_floor_end_at_once() -> None:
    floor = Aisle()
    for _ in floor.seconds(40):
        floor.say("stands", 12.0, **IDLE)
        floor.say("first", 10.5, 0.0, 1.0, velocity={"linear": 0.0})
    assert {each.kind for each in floor.judge.open()} == {"blockage"}
    floor.mark(is_off=True)
    floor.tick()
    floor.wait(1.0)
    ended = [each for each in floor.judged if each.state is AdvisoryState.CLEARED]
    assert [each.cleared_code for each in ended] == [ClearedCode.OFF_FLOOR]
    assert floor.judge.open() == []


def test_what_a_robot_that_was_moved_by_hand_was_a_party_of_ends_and_its_leap_passes_through_nobody() -> None:
    floor = Aisle()
    floor.stand("asleep", 18.0, seconds=5)
    floor.wait(40.0)
    for second, _ in enumerate(floor.seconds(14)):
        floor.say("stands", 12.0, **IDLE)
        floor.say("first", min(-9.0 + second, 9.0), 0.0, 1.0)
    assert [each.kind for each in floor.engine.open()] == ["conflict"]
    before = floor.engine.live.robots[robot("stands")]
    floor.say("stands", 30.0, **IDLE)
    floor.tick()
    floor.wait(1.0)
    (cleared,) = floor.of("conflict", AdvisoryState.CLEARED)
    assert cleared.cleared_code is ClearedCode.MOVED_BY_HAND
    assert robot("asleep") not in floor.presence.removed.robots
    assert floor.engine.live.robots[robot("stands")].forecast.x_m.tolist() == [30.0]
    assert floor.engine.live.robots[robot("stands")] is not before, "nothing of it is continued"
