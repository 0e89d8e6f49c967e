"""What was learned of standoffs and of requests goes on over a restart, and who yielded is forgotten after a shift."""

from pathlib import Path

import pytest

from deconflict.adviser import asked
from deconflict.adviser.asked import UNABLE_S, Asked, Following, Request
from deconflict.adviser.standoff_advice import StandoffAdvice
from deconflict.adviser.worth import YIELDED_HALF_LIFE_S, Worth
from deconflict.engine.engine import Engine
from deconflict.operator.store.learned_file import LearnedFile
from deconflict.runtime.learned_state import Part, packed, unpacked
from deconflict.settings.site import DEFAULT
from deconflict_client.advisory.robot_advice import YIELDED
from ingest.measures.measures import Measures
from tests.deconflict.adviser.advised_floor import CANNOT, OBEYS, SILENT, AdvisedFloor
from tests.deconflict.adviser.floors import START_S, face_to_face
from tests.deconflict.engine.learned.json_damages import json_damages

PARTS = {"standoffs", "requests"}


def restarted(floor: AdvisedFloor, directory: Path) -> AdvisedFloor:
    """The same robots before an engine that begins with the file of the one before."""
    file = LearnedFile(directory, Measures())
    file.write(packed(floor.engine.learned()))
    later = AdvisedFloor(floor.robots, floor.reply, second=floor.second)
    later.engine = Engine(DEFAULT, learned=unpacked(file.read()))
    assert not later.engine.set_aside
    return later


def two_pairs() -> AdvisedFloor:
    """None of their robots can go around another."""
    robots = [*face_to_face(name="1"), *face_to_face(y_m=30.0, name="2")]
    return AdvisedFloor(robots, lambda advice: CANNOT if advice.verb == "go_around" else SILENT)


def verbs_of(floor: AdvisedFloor) -> set[str]:
    return {line.split()[2] for line in floor.asked()}


def test_vendors_are_not_asked_again_after_a_restart_what_they_cannot_do(tmp_path: Path) -> None:
    floor = two_pairs().run(30)
    assert verbs_of(floor) > {"go_around"}
    again = restarted(floor, tmp_path).run(40)
    assert verbs_of(again)
    assert "go_around" not in verbs_of(again)


def first_asked(learned: dict[str, Part]) -> str:
    floor = AdvisedFloor(list(face_to_face()))
    floor.engine = Engine(DEFAULT, learned=Engine(DEFAULT).learned() | learned)
    return floor.run(12).asked()[0].split()[1]


def test_who_has_yielded_more_is_asked_last_after_a_restart_and_first_again_after_two_shifts() -> None:
    worth, now_s = Worth(), START_S
    worth.add_yield("go_around", "Larch", "Rowan", 100.0, now_s)
    assert first_asked({}) == "l"
    assert first_asked({"standoffs": worth.learned()}) == "r"
    earlier = Worth()
    earlier.add_yield("go_around", "Larch", "Rowan", 100.0, now_s - 2 * YIELDED_HALF_LIFE_S)
    assert first_asked({"standoffs": earlier.learned()}) == "l"


def test_what_vendors_yield_after_a_restart_adds_to_what_was_before() -> None:
    before, after = Worth(), Worth()
    before.add_yield("go_around", "Larch", "Rowan", 80.0, START_S)
    after.resume(before.learned())
    after.add_yield("go_around", "Larch", "Rowan", 5.0, START_S + YIELDED_HALF_LIFE_S)
    assert after.yielded_s == {("Larch", "Rowan"): pytest.approx(45.0)}
    assert after.takes["go_around"].ends == 2


def test_a_clock_that_goes_back_adds_and_forgets_nothing() -> None:
    worth = Worth()
    worth.add_yield("go_around", "Larch", "Rowan", 80.0, START_S)
    worth.yields_too_much("Larch", "Rowan", START_S - 3600.0)
    assert worth.yielded_s == {("Larch", "Rowan"): 80.0}


def yielded_metric(floor: AdvisedFloor) -> float:
    rows = floor.engine.measures.as_document()["values"].get(YIELDED, [])
    return sum(seconds for _, seconds in rows)


def test_the_counter_of_yielded_seconds_never_falls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    floor = AdvisedFloor(list(face_to_face()), lambda _: OBEYS).run(20)
    counted_s = yielded_metric(floor)
    assert counted_s > 0.0
    assert yielded_metric(restarted(floor, tmp_path)) == 0.0, "it counts from the start of the engine, as others do"
    learner = floor.engine._shared.asked.standoffs._worth
    learner.yields_too_much("Larch", "Rowan", floor.now_s + 10 * 86400.0)
    assert not learner.yielded_s
    assert yielded_metric(floor) == counted_s
    fail(floor, monkeypatch)
    assert yielded_metric(floor) == counted_s


def fail(floor: AdvisedFloor, monkeypatch: pytest.MonkeyPatch) -> None:
    """The adviser raises at its next look."""

    def fails(*_: object) -> None:
        raise KeyError("robot")

    with monkeypatch.context() as patched:
        patched.setattr(StandoffAdvice, "step", fails)
        with pytest.raises(KeyError):
            floor.run(1)


def test_an_adviser_that_fails_forgets_and_what_is_learned_after_that_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    floor = two_pairs().run(30)
    assert floor.engine.learned()["requests"]["can"]
    fail(floor, monkeypatch)
    assert not floor.engine.learned()["requests"]["can"]
    assert floor.run(40).engine.learned()["requests"]["can"]


def test_a_file_without_what_is_learned_of_advice_is_taken_as_before() -> None:
    learned = two_pairs().run(30).engine.learned()
    older = {name: part for name, part in learned.items() if name not in PARTS}
    engine = Engine(DEFAULT, learned=unpacked(packed(older)))
    assert not engine.set_aside
    assert engine.learned().keys() == learned.keys()
    assert packed({name: engine.learned()[name] for name in older}) == packed(older)


def test_a_changed_site_goes_on_with_what_was_learned_and_its_own_rule_of_verbs() -> None:
    floor = two_pairs().run(30)
    vendors = [{"name": "Larch", "verbs": []}, {"name": "Rowan", "verbs": ["go_around"]}]
    site = DEFAULT.model_validate({"vendors": vendors})
    renewed = floor.engine.renewed(site)
    assert not renewed.set_aside
    following = renewed._shared.asked.standoffs._following
    assert not following.can("Larch", "back_out", floor.now_s)
    assert not following.can("Rowan", "go_around", floor.now_s), "the site allows it, but the robots cannot"


def filled() -> dict[str, Part]:
    """The two parts of a floor where something of everything was learned."""
    worth, following = Worth(), Following({})
    worth.add_yield("go_around", "Larch", "Rowan", 80.0, START_S)
    worth.observe("ring", {frozenset("ab")}, set(), START_S)
    worth.observe("ring", set(), set(), START_S + 4.0)
    for robot, answer, why in (("a", "declined", "cannot"), ("b", "accepted", ""), ("c", "declined", "no room")):
        reply(following, robot, answer, why, START_S)
    following.follow("b")
    return {"standoffs": worth.learned(), "requests": following.learned()}


def reply(following: Following, robot: str, answer: str, why: str, now_s: float, x_m: float = 0.0) -> None:
    request = Request("1", robot, "go_around", None, "z", ("z",), now_s + 20.0)
    following.ask(robot, now_s)
    following.answer(Asked(request, now_s, (x_m, 0.0), 0.0), "Larch", answer, why, now_s)


def test_what_is_kept_is_what_was_learned() -> None:
    parts = filled()
    engine = Engine(DEFAULT, learned=unpacked(packed(Engine(DEFAULT).learned() | parts)))
    assert {name: engine.learned()[name] for name in PARTS} == parts
    assert parts["requests"]["robots"] == {"b": [1.0, 1.0]}
    assert parts["standoffs"]["stands_on"]["ring"] == [4.0, 1]


def test_a_damaged_part_loses_only_itself() -> None:
    parts, tried = Engine(DEFAULT).learned() | filled(), 0
    for name in PARTS:
        for key, value in parts[name].items():
            for damaged in json_damages(value):
                engine = Engine(DEFAULT, learned=parts | {name: parts[name] | {key: damaged}})
                assert set(engine.set_aside) <= {name}
                (other,) = PARTS - {name}
                assert engine.learned()[other] == parts[other]
                assert unpacked(packed(engine.learned()))
                tried += bool(engine.set_aside)
    assert tried > 50


def test_a_robot_that_could_not_is_one_robot_after_a_restart_and_its_vendor_is_asked_again_after_a_week() -> None:
    following = Following({})
    for robot, may in (("a", True), ("a", True), ("b", False)):
        reply(following, robot, "declined", "cannot", START_S)
        resumed = Following({})
        resumed.resume(following.learned())
        assert resumed.can("Larch", "go_around", START_S) == may
        following = resumed
    assert not following.can("Larch", "go_around", START_S + UNABLE_S - 1.0)
    assert following.can("Larch", "go_around", START_S + UNABLE_S)


def test_squares_and_counts_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(asked, "MOST_PLACES", 3)
    following = Following({})
    for x_m in (0.0, 10.0, 20.0, 0.0, 30.0):
        reply(following, "a", "accepted", "", START_S, x_m)
    assert [place[1] for place in following.learned()["places"]] == [6, 0, 10]
    for _ in range(1000):
        reply(following, "b", "accepted", "", START_S)
    reply(following, "b", "declined", "no room", START_S)
    assert following.likely("b") < 0.1
    for _ in range(100):
        reply(following, "b", "declined", "no room", START_S)
    assert following.possible("go_around", (0.0, 0.0)) < 0.5, "a changed place is soon believed"
    assert not Engine(DEFAULT, learned=Engine(DEFAULT).learned() | {"requests": following.learned()}).set_aside
