import numpy as np
import pytest

from deconflict.foresight.presence.silence_outcomes import (
    ELSEWHERE,
    LEFT,
    MAYBE_LEFT,
    MAYBE_THERE,
    THERE,
    LastSeen,
    SilenceOutcomes,
)
from deconflict.runtime.learned_state import UnreadableError, packed, unpacked
from ingest.batch import FloorPoint

DOOR = FloorPoint("hall", 40.0, 5.0)
GRACE_S = 5.0


def left_at(
    outcomes: SilenceOutcomes, spot: FloorPoint, times: int, vendor: str = "Alder", last: LastSeen = LastSeen.GOING
) -> None:
    for _ in range(times):
        outcomes.count(outcomes.case(vendor, spot, last), {LEFT: 1.0})


def there(
    outcomes: SilenceOutcomes, spot: FloorPoint, silent_s: float, vendor: str = "Alder", last: LastSeen = LastSeen.GOING
) -> float:
    return outcomes.there(outcomes.case(vendor, spot, last), silent_s, GRACE_S)


def test_by_the_prior_a_silent_robot_is_mostly_present() -> None:
    outcomes = SilenceOutcomes()
    assert there(outcomes, DOOR, 5.0) == pytest.approx(0.9)
    assert there(outcomes, DOOR, 60.0) > 0.75
    assert there(outcomes, DOOR, 60.0, last=LastSeen.STANDING) > 0.95


def test_a_robot_has_probably_left_only_where_others_have_left() -> None:
    outcomes = SilenceOutcomes()
    left_at(outcomes, DOOR, 20)
    assert there(outcomes, DOOR, 5.0) < 0.15
    assert there(outcomes, FloorPoint("hall", 40.5, 5.8), 5.0) < 0.3
    assert there(outcomes, FloorPoint("hall", 20.0, 5.0), 5.0) > 0.55
    assert there(outcomes, FloorPoint("loft", 40.0, 5.0), 5.0) > 0.55
    assert there(outcomes, DOOR, 5.0, last=LastSeen.ARRIVED) < 0.15
    assert there(outcomes, DOOR, 5.0, last=LastSeen.STANDING) > 0.95


def test_a_place_counts_for_the_vendors_that_have_not_left_there_yet() -> None:
    outcomes = SilenceOutcomes()
    left_at(outcomes, DOOR, 20, vendor="Alder")
    assert there(outcomes, DOOR, 5.0, vendor="Corvid") < 0.15
    assert there(outcomes, FloorPoint("hall", 0.0, 0.0), 5.0, vendor="Corvid") == pytest.approx(0.9)


def test_robots_that_leave_anywhere_are_known_by_their_vendor() -> None:
    outcomes, rng = SilenceOutcomes(), np.random.default_rng(1)
    for x_m, y_m in rng.uniform(0, 200, (40, 2)):
        left_at(outcomes, FloorPoint("hall", x_m, y_m), 1)
    assert there(outcomes, FloorPoint("hall", 300.0, 0.0), 10.0) < 0.15
    assert there(outcomes, FloorPoint("hall", 300.0, 0.0), 10.0, vendor="Corvid") > 0.85


def test_silences_that_ended_where_the_robot_was_keep_the_next_one_there() -> None:
    outcomes = SilenceOutcomes()
    for lasted_s in (12.0, 35.0, 58.0) * 10:
        case = outcomes.case("Alder", DOOR, LastSeen.GOING)
        outcomes.count(case, {THERE: 1.0})
        outcomes.count_length(case, lasted_s)
    assert there(outcomes, DOOR, 40.0) > 0.95


def test_a_silence_does_not_count_as_evidence_for_itself() -> None:
    outcomes = SilenceOutcomes()
    case = outcomes.case("Alder", DOOR, LastSeen.GOING)
    before = outcomes.there(case, 20.0, GRACE_S)
    outcomes.count(case, {MAYBE_THERE: 0.2, MAYBE_LEFT: 0.8})
    assert outcomes.there(case, 20.0, GRACE_S) == pytest.approx(before)
    assert there(outcomes, DOOR, 20.0) < before


def test_returns_elsewhere_do_not_make_an_exit() -> None:
    outcomes = SilenceOutcomes()
    cases = [outcomes.case("Alder", DOOR, LastSeen.GOING) for _ in range(5)]
    for case in cases:
        outcomes.count(case, {LEFT: 1.0})
    assert [(usual_exit.x_m, usual_exit.y_m, usual_exit.robots) for usual_exit in outcomes.exits()] == [(40.0, 5.0, 5)]
    for case in cases:
        outcomes.count(case, {ELSEWHERE: 1.0})
    assert outcomes.exits() == []
    assert there(outcomes, DOOR, 5.0) < 0.3


def test_exits_are_where_most_robots_that_fall_silent_leave() -> None:
    outcomes = SilenceOutcomes()
    left_at(outcomes, DOOR, 6)
    left_at(outcomes, FloorPoint("hall", 40.6, 5.9), 6)
    left_at(outcomes, FloorPoint("hall", 0.0, 0.0), 2)
    left_at(outcomes, FloorPoint("loft", 9.0, 9.0), 4)
    for _ in range(12):
        outcomes.count(outcomes.case("Alder", FloorPoint("loft", 9.0, 9.0), LastSeen.GOING), {THERE: 1.0})
    (exit_,) = outcomes.exits()
    assert (exit_.datum, exit_.robots) == ("hall", 12)
    assert [exit_.x_m, exit_.y_m] == pytest.approx([40.3, 5.4], abs=0.1)


def test_known_outcomes_are_kept_over_a_restart_and_probable_ones_are_not() -> None:
    outcomes, after = SilenceOutcomes(), SilenceOutcomes()
    left_at(outcomes, DOOR, 20)
    case = outcomes.case("Alder", FloorPoint("hall", 0.0, 0.0), LastSeen.GOING)
    outcomes.count(case, {MAYBE_LEFT: 1.0})
    after.resume(unpacked(packed({"silences": outcomes.learned()}))["silences"])
    assert after.exits() == outcomes.exits()
    assert there(after, DOOR, 5.0) < 0.15
    assert there(after, FloorPoint("hall", 0.0, 0.0), 5.0) > there(outcomes, FloorPoint("hall", 0.0, 0.0), 5.0)


@pytest.mark.parametrize("spoilt", [{"cells": None}, {"cells": [["hall", 1]]}, {"lasted": np.zeros((9, 9))}])
def test_unreadable_outcomes_are_refused(spoilt: dict[str, object]) -> None:
    outcomes = SilenceOutcomes()
    left_at(outcomes, DOOR, 3)
    with pytest.raises(UnreadableError):
        SilenceOutcomes().resume(outcomes.learned() | spoilt)
