"""Situations of a cluster: one engine owns them, another continues them, and two never fork one."""

from typing import Any

from deconflict.cluster.judging.global_engine import StreamSituations
from deconflict.settings.site import Site
from deconflict_client.advisory import Location, Severity, moment
from deconflict_client.situations import AnyRevision, Situation
from ingest.measures.measures import Measures
from tests.helpers.made_advisories import made

NOW_S = 1_790_000_000.0
ROBOTS = [f"0c5b4a7e-0000-4000-8000-{number:012d}" for number in range(9)]


def conflict(number: int, revision: int = 1, at_s: float = NOW_S, x_m: float = 0.0, **fields: Any) -> AnyRevision:
    """A conflict that is worth a person's reaction."""
    place = Location(datum="5f1d0000-0000-4000-8000-00000000000a", x=x_m, y=0.0)
    times = {"raised_at": moment(NOW_S), "updated_at": moment(at_s), "predicted_at": moment(at_s + 9)}
    robots = (ROBOTS[2 * number], ROBOTS[2 * number + 1])
    whole: dict[str, Any] = {"robots": robots, "location": place, "severity": Severity.CRITICAL, "probability": 0.9}
    return made(number, revision, **(whole | {"time_to_conflict_s": 9.0} | times | fields))


def opened(measures: Measures) -> tuple[StreamSituations, Situation]:
    situations = StreamSituations(Site(), [])
    (raised,) = situations.revise(NOW_S, [conflict(1)], measures)
    return situations, raised


def test_a_situation_is_raised_on_an_advisory_of_any_engine_and_counted() -> None:
    measures = Measures()
    _, raised = opened(measures)
    assert (raised.state, raised.advisories) == ("raised", ("advisory-1",))
    assert measures.values["deconflict_situations_total"] == {(raised.situation_kind, "raised"): 1}
    assert sum(measures.values["deconflict_situations_open"].values()) == 1


def test_an_engine_that_takes_over_continues_the_situation_under_its_id() -> None:
    _, raised = opened(Measures())
    second = StreamSituations(Site(), [conflict(1), raised])
    later_s = NOW_S + 60
    ended = conflict(1, 2, later_s, state="cleared", cleared_at=moment(later_s), cleared_because="they passed")
    revisions = second.revise(later_s, [ended], Measures())
    revisions += second.revise(later_s + 30, [], Measures())
    assert {revision.id for revision in revisions} == {raised.id}
    assert [revision.revision for revision in revisions] == list(range(2, 2 + len(revisions)))
    assert revisions[-1].state == "cleared"


def test_its_own_revisions_come_back_from_the_stream_and_are_no_others() -> None:
    situations, raised = opened(Measures())
    assert not situations.is_overtaken([conflict(1), raised], [])
    later_s = NOW_S + 60
    ended = conflict(1, 2, later_s, state="cleared", cleared_at=moment(later_s), cleared_because="they passed")
    cleared = [*situations.revise(later_s, [ended], Measures()), *situations.revise(later_s + 30, [], Measures())]
    assert not situations.is_overtaken(cleared, [])


def test_what_another_engine_wrote_of_situations_is_noticed() -> None:
    situations, raised = opened(Measures())
    foreign = raised.model_copy(update={"id": "another situation"})
    assert situations.is_overtaken([foreign], [])
    assert situations.is_overtaken([raised.next_revision()], [])
    assert situations.is_overtaken([], [raised])
    assert not situations.is_overtaken([conflict(2)], [conflict(3)])
