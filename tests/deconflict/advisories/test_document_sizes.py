"""Advisories on hundreds of robots: their documents stay small, and what they leave out makes no revision."""

from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest

from deconflict.advice.document_limits import MOST_DOCUMENT_BYTES
from deconflict.advisories.conflict_lifecycle import ConflictLifecycle
from deconflict.advisories.finding_lifecycle import Finding, FindingLifecycle, NamedRobot, finding_key
from deconflict.advisories.situations.situation_lifecycle import SituationLifecycle
from deconflict.advisories.words.words import RevisionWords, Spot, words
from deconflict.settings.site import Conflict
from deconflict_client.advisory import (
    Action,
    AnyAdvisory,
    BlockageAdvisory,
    DeadlockAdvisory,
    Hold,
    Location,
    Recommendation,
    Severity,
    Slot,
    Wait,
    moment,
)
from deconflict_client.situations import MOST_ADVISORIES, MOST_ROBOTS, REVISION
from tests.helpers.made_advisories import made
from tests.helpers.saying import HALL

NOW_S = 1_790_000_000.0
UUIDS = tuple(f"0c5b4a7e-0000-4000-8000-{number:012d}" for number in range(220))
HERE = Location(datum=HALL, x=0.0, y=0.0)
USUAL_NAME, LONGEST_NAME = "Alder Robotics AMR 0000000042", "\x01" * 201


def they_wait() -> RevisionWords:
    return RevisionWords("they wait", "they wait")


def blockage(held_up: tuple[str, ...], blocker: str = UUIDS[-1]) -> Finding:
    evidence = {"blocker": blocker, "since_at": moment(NOW_S), "holds_up": held_up}
    robots = tuple(sorted((blocker, *held_up)))
    return Finding("blockage", blocker, Severity.WARNING, robots, NOW_S, HERE, they_wait, evidence)


def ring(count: int) -> Finding:
    robots = UUIDS[:count]
    waits = zip(robots, robots[1:] + robots[:1], strict=True)
    cycle = tuple(Wait(waiter=a, holder=b, where="path", from_at=moment(NOW_S)) for a, b in waits)
    way_out = plan(robots)
    found = Finding(
        "deadlock",
        " ".join(robots),
        Severity.WARNING,
        robots,
        NOW_S,
        HERE,
        they_wait,
        {"cycle": cycle},
    )
    return found._replace(recommendation=way_out)


def shortage(count: int) -> Finding:
    chargers = tuple(f"charger-{number}" for number in range(count))
    evidence = {
        "resource": "charger-0",
        "resource_name": " and ".join(chargers),
        "capacity": count,
        "demand": count,
        "queue_length": 1,
        "wait_s": 30.0,
        "resources": chargers,
    }
    found = Finding("contention", "charger-0", Severity.CAUTION, UUIDS, NOW_S, HERE, they_wait, evidence)
    return found._replace(recommendation=plan(UUIDS))


def plan(robots: tuple[str, ...]) -> Recommendation:
    start_at, end_at = moment(NOW_S), moment(NOW_S) + timedelta(seconds=30)
    slots = [Slot(robot=robot, resource="charger-0", start_at=start_at, end_at=end_at, wait_s=1.0) for robot in robots]
    return Recommendation(slots=tuple(slots), cost_s=1.0, bound_s=0.0, proven_optimal=False)


def raised(finding: Finding, name: str = USUAL_NAME) -> AnyAdvisory:
    lifecycle = FindingLifecycle(3.0)
    looks = [lifecycle.revise(NOW_S + second, [finding], lambda _: NamedRobot(name, "Alder")) for second in range(2)]
    (advisory,) = looks[1]
    return advisory


@pytest.mark.parametrize(("name", "most_bytes"), [(USUAL_NAME, 10_000), (LONGEST_NAME, MOST_DOCUMENT_BYTES)])
@pytest.mark.parametrize("found", [blockage(UUIDS[:-1]), ring(220), shortage(220)], ids=lambda found: found.kind)
def test_a_finding_on_hundreds_of_robots_has_a_small_document(found: Finding, name: str, most_bytes: int) -> None:
    text = f"{', '.join([name] * 4)} and 216 others" + " wait" * (30 if name == USUAL_NAME else 9_999)
    advisory = raised(found._replace(words=lambda: words(lambda _: text)), name)
    assert len(advisory.model_dump_json()) < most_bytes
    assert len(advisory.robots) == len(advisory.names) == len(advisory.vendors) == MOST_ROBOTS
    assert advisory.more_robots == 200


@pytest.mark.parametrize(("name", "most_bytes"), [(USUAL_NAME, 8_000), (LONGEST_NAME, MOST_DOCUMENT_BYTES)])
def test_a_conflict_in_a_group_of_hundreds_has_a_small_document(name: str, most_bytes: int) -> None:
    lifecycle = ConflictLifecycle(Conflict(), absent_after_s=10.0)
    pair = UUIDS[100], UUIDS[219]
    lifecycle.restore([made(1, robots=pair, names=(USUAL_NAME, USUAL_NAME))])
    holds = tuple(Hold(robot=uuid, hold_s=1.0) for uuid in UUIDS)
    note = f"no hold works for {', '.join([name] * 220)}: {name} needs another route"
    waits = tuple(Action(robot=uuid, name=name, action="wait", seconds=3.0, reason=name * 2) for uuid in UUIDS)
    advice = Recommendation(holds=holds, actions=waits, cost_s=1.0, bound_s=0.0, proven_optimal=False, note=note)
    advisory = lifecycle.add_advice(pair, advice, NOW_S)
    assert advisory
    assert advisory.recommendation
    assert len(advisory.model_dump_json()) < most_bytes
    assert {hold.robot for hold in advisory.recommendation.holds}.issuperset(pair)
    assert advisory.summary.count("should wait") == 3
    other_order = advice.model_copy(update={"holds": (*holds[:50], *reversed(holds[50:]))})
    assert lifecycle.add_advice(pair, other_order, NOW_S + 60) is None


def test_a_blockage_keeps_its_blocker_and_those_that_it_delays_first() -> None:
    soonest_first = UUIDS[:0:-1]
    advisory = raised(blockage(soonest_first, UUIDS[0]))
    assert isinstance(advisory, BlockageAdvisory)
    assert advisory.holds_up == soonest_first[: MOST_ROBOTS - 1]
    assert advisory.robots == (UUIDS[0], *sorted(advisory.holds_up))


def test_the_order_of_what_is_left_out_makes_no_revision() -> None:
    lifecycle = FindingLifecycle(3.0)
    orders: list[Callable[[tuple[str, ...]], tuple[str, ...]]] = [lambda rest: rest, lambda rest: rest[::-1]]
    revisions = []
    for second in range(30):
        found = blockage(UUIDS[:50] + orders[second % 2](UUIDS[50:-1]))
        revisions += lifecycle.revise(NOW_S + second, [found], lambda _: NamedRobot(USUAL_NAME, "Alder"))
    assert [revision.state.value for revision in revisions] == ["raised"]


def test_a_long_ring_is_the_same_finding_after_a_restart() -> None:
    advisory = raised(ring(220))
    assert isinstance(advisory, DeadlockAdvisory)
    resumed = FindingLifecycle(3.0, [advisory])
    assert resumed.revise(NOW_S + 60, [ring(220)], lambda _: NamedRobot(USUAL_NAME, "Alder")) == []
    whole = advisory.model_copy(update={"robots": UUIDS})
    assert finding_key(whole) == finding_key(advisory), "as an earlier release stored it"


def test_a_finding_of_few_robots_leaves_nothing_out() -> None:
    advisory = raised(ring(MOST_ROBOTS))
    assert len(advisory.robots) == MOST_ROBOTS
    assert "more_robots" not in advisory.model_dump()


@pytest.mark.parametrize(("name", "most_bytes"), [(USUAL_NAME, 10_000), (LONGEST_NAME, MOST_DOCUMENT_BYTES)])
def test_a_situation_of_hundreds_of_advisories_and_robots_is_a_small_document(name: str, most_bytes: int) -> None:
    now_s, place = NOW_S + 2, Location(datum="5f1d0000-0000-4000-8000-00000000000a", x=0.0, y=0.0)
    when = {"raised_at": moment(NOW_S), "updated_at": moment(now_s), "predicted_at": moment(now_s + 5)}
    at: dict[str, Any] = {"location": place, **when}
    shown = name[:100].replace("\x01", "x")
    conflicts = [
        made(number, robots=(UUIDS[0], UUIDS[number]), names=(shown, shown), severity=Severity.CRITICAL, **at)
        for number in range(1, 200)
    ]
    knot = raised(ring(220), name).model_copy(update=at)
    lifecycle = SituationLifecycle(lambda points: [Spot(shown)] * len(points))
    situations = lifecycle.revise(now_s, [knot, *conflicts])
    assert situations
    for situation in situations:
        document = situation.model_dump_json()
        assert len(document.encode()) <= most_bytes
        assert REVISION.validate_json(document) == situation
        assert len(situation.robots) <= MOST_ROBOTS
        assert len(situation.advisories) <= MOST_ADVISORIES
