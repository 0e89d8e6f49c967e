"""The life of advisories on contention, look by look."""

from itertools import pairwise
from typing import Any

import pytest

from deconflict.advisories.finding_lifecycle import (
    RESTORED_S,
    UPDATE_GAP_S,
    Finding,
    FindingAdvisory,
    FindingLifecycle,
    NamedRobot,
)
from deconflict.advisories.words.words import RevisionWords
from deconflict_client.advisory import ContentionAdvisory, Location, Severity
from tests.helpers.saying import HALL

NOW_S = 1_790_000_000.0
A_QUEUE = RevisionWords("a queue", "a queue")


def finding(wait_s: float = 30.0, severity: Severity = Severity.CAUTION, in_s: float = 60.0) -> Finding:
    evidence: dict[str, Any] = {
        "resource": "c1",
        "resource_name": "Charger 1",
        "capacity": 1,
        "demand": 2,
        "queue_length": 1,
        "wait_s": wait_s,
    }
    here = Location(datum=HALL, x=0.0, y=0.0)
    return Finding("contention", "c1", severity, ("a", "b"), NOW_S + in_s, here, lambda: A_QUEUE, evidence)


def named(uuid: str) -> NamedRobot:
    return NamedRobot(uuid.upper(), "Alder")


def run(lifecycle: FindingLifecycle, *looks: Finding | None, from_s: float = 0.0) -> list[FindingAdvisory]:
    """One look a second."""
    advisories: list[FindingAdvisory] = []
    for second, made_finding in enumerate(looks):
        advisories += lifecycle.revise(NOW_S + from_s + second, [made_finding] if made_finding else [], named)
    return advisories


def states(advisories: list[FindingAdvisory]) -> list[str]:
    return [advisory.state.value for advisory in advisories]


def test_one_look_of_three_is_not_enough() -> None:
    assert run(FindingLifecycle(3.0), finding(), None, None, finding(), None, None) == []


def test_two_looks_of_three_raise_it_and_its_absence_clears_it() -> None:
    advisories = run(FindingLifecycle(3.0), finding(), None, finding(), finding(), None, None, None, None)
    assert states(advisories) == ["raised", "cleared"]
    assert advisories[0].id == advisories[1].id
    assert advisories[1].updated_at.timestamp() - NOW_S == 6
    assert advisories[0].names == ("A", "B")


def test_a_flicker_clears_nothing() -> None:
    assert states(run(FindingLifecycle(3.0), finding(), finding(), None, None, finding(), None, None, finding())) == [
        "raised"
    ]


@pytest.mark.parametrize(("wait_s", "updates"), [(31.0, 0), (35.0, 0), (37.0, 1)])
def test_a_wait_is_updated_when_it_has_changed_enough(wait_s: float, updates: int) -> None:
    advisories = run(FindingLifecycle(3.0), finding(), finding(), *[finding(wait_s)] * 6)
    assert states(advisories) == ["raised"] + ["updated"] * updates


def test_updates_keep_a_gap_unless_severity_rises() -> None:
    waits = [finding(30.0 + 20 * step) for step in range(24)]
    advisories = run(FindingLifecycle(3.0), *waits)
    gaps = [b.updated_at.timestamp() - a.updated_at.timestamp() for a, b in pairwise(advisories)]
    assert len(advisories) > 3
    assert min(gaps) >= UPDATE_GAP_S
    assert states(run(FindingLifecycle(3.0), finding(), finding(), finding(severity=Severity.WARNING))) == [
        "raised",
        "updated",
    ]


def test_a_restored_advisory_keeps_its_id() -> None:
    (before,) = run(FindingLifecycle(3.0), finding(), finding())
    advisories = run(FindingLifecycle(3.0, [before]), None, None, finding(60.0), from_s=10.0)
    assert isinstance(advisories[0], ContentionAdvisory)
    assert [(advisory.id, advisory.revision) for advisory in advisories] == [(before.id, 2)]
    assert advisories[0].wait_s == 60.0


def test_a_restored_advisory_that_is_not_found_again_is_cleared_in_time() -> None:
    (before,) = run(FindingLifecycle(3.0), finding(), finding())
    advisories = run(FindingLifecycle(3.0, [before]), *[None] * 20, from_s=100.0)
    assert states(advisories) == ["cleared"]
    assert advisories[0].updated_at.timestamp() == NOW_S + 100 + RESTORED_S
