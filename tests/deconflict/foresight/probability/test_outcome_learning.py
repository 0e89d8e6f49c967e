import numpy as np
import pytest

from deconflict.foresight.probability.censoring import STAYED, CensoredOutcomes
from deconflict.foresight.probability.outcome_learning import AnsweredQuestion, OpenQuestions, OwnUntil
from deconflict.foresight.probability.pair_table import FEATURES, PAIR, Pairs, codes, select_pairs, slots_of
from ingest.batch import Floats

NOW_S = 1_790_000_000.0


def pairs(*slots: tuple[int, int]) -> Pairs:
    a, b = np.array(slots, np.int64).T
    return select_pairs(np.zeros(0, PAIR), codes(a, b), np.zeros(10, bool), np.zeros(10, bool), NOW_S).pairs


def heard_until(robot_s: Floats) -> OwnUntil:
    """Robots drove unadvised until then, by slot."""
    return lambda code, _: np.minimum(*(robot_s[slots] for slots in slots_of(code)))


def outcome(
    *, started_s: list[float], last_within_s: list[float], heard_s: list[float], **columns: list[float]
) -> tuple[AnsweredQuestion, CensoredOutcomes]:
    """The outcomes of the pairs (0, 1), (0, 2) ... of a question at `NOW_S`."""
    every = pairs(*((0, n + 1) for n in range(len(started_s))))
    every["started_s"], every["last_within_s"] = NOW_S + np.array(started_s), NOW_S + np.array(last_within_s)
    for name, after_s in columns.items():
        every[name] = NOW_S + np.array(after_s)
    questions = OpenQuestions(horizon_s=10.0)
    questions.ask(NOW_S, every["code"], every["features"])
    heard = NOW_S + np.array(heard_s)
    assert questions.answered(NOW_S + 15, every, heard_until(heard)) == []
    (known,) = questions.answered(NOW_S + 16, every, heard_until(heard))
    return known, known.interacted


def test_an_outcome_is_known_once_the_horizon_is_over() -> None:
    # the first met before one left, of the second one left, the third stayed apart
    never = [-np.inf] * 2
    question, outcomes = outcome(started_s=[4.5, *never], last_within_s=[5.0, *never], heard_s=[12, 5.5, 6.5, 12])
    assert (question.asked_s, len(question.code)) == (NOW_S, 3)
    assert outcomes.met.tolist() == [True, False, False]
    assert outcomes.left.tolist() == [False, True, False]
    assert outcomes.part.tolist() == [4, 6, STAYED]


def test_an_encounter_after_the_horizon_does_not_count() -> None:
    _, outcomes = outcome(started_s=[10.5], last_within_s=[10.8], heard_s=[13, 13])
    assert (outcomes.met.tolist(), outcomes.left.tolist(), outcomes.part.tolist()) == ([False], [False], [STAYED])


def test_a_pair_in_an_encounter_when_asked_is_left_out() -> None:
    question, _ = outcome(started_s=[-0.5, -5.0], last_within_s=[0.4, -3.0], heard_s=[12, 12, 12])
    assert question.code.tolist() == codes(np.array([0]), np.array([2])).tolist()


def test_a_pair_of_which_one_gave_way_has_met_without_touching() -> None:
    never, heard_s = [-np.inf], [20.0, 20.0]
    known, outcomes = outcome(
        started_s=never, last_within_s=never, heard_s=heard_s, yielded_s=[4.5], yield_end_s=[np.inf]
    )
    assert (outcomes.met.tolist(), outcomes.part.tolist(), known.touched.met.tolist()) == ([True], [4], [False])


def test_a_pair_that_was_giving_way_when_asked_is_left_out() -> None:
    never, heard_s = [-np.inf], [20.0, 20.0]
    known, _ = outcome(started_s=never, last_within_s=never, heard_s=heard_s, yielded_s=[-4.5], yield_end_s=[2.0])
    assert len(known.code) == 0


def test_a_possible_order_of_the_fleet_is_left_out() -> None:
    never, heard_s = [-np.inf], [20.0, 20.0]
    known, _ = outcome(started_s=never, last_within_s=never, heard_s=heard_s, uncertain_s=[4.0])
    assert len(known.code) == 0


def test_outcomes_equal_those_computed_pair_by_pair() -> None:
    """Pairs that are no longer in the table did not meet."""
    rng, n = np.random.default_rng(6), 300
    every = pairs(*((int(a), int(b)) for a, b in rng.integers(0, 10, (n, 2))))
    every["started_s"], every["last_within_s"] = NOW_S + rng.uniform(-5, 15, (2, len(every)))
    every["started_s"][::4] = every["last_within_s"][::4] = -np.inf
    asked = np.unique(np.concatenate([every["code"][::2], codes(*rng.integers(0, 10, (2, 20)))]))
    until_s = NOW_S + rng.uniform(-1, 15, 10)
    until_s[3] = -np.inf
    questions = OpenQuestions(horizon_s=10.0)
    questions.ask(NOW_S, asked, np.zeros((len(asked), FEATURES)))
    (question,) = questions.answered(NOW_S + 16, every, heard_until(until_s))
    outcomes = question.interacted
    found = {int(row["code"]): (row["started_s"], row["last_within_s"]) for row in every}
    expected = []
    for code in asked.tolist():
        started_s, below_s = found.get(code, (-np.inf, -np.inf))
        a, b = slots_of(code)
        last_s = min(until_s[a], until_s[b])
        if last_s > -np.inf and (started_s > NOW_S or below_s < NOW_S):
            met = NOW_S < started_s <= min(NOW_S + 10, last_s)
            part = int(min(max((started_s if met else last_s) - NOW_S, 0), STAYED - met))
            expected.append((code, met, part, not met and part < STAYED))
    result = (question.code.tolist(), outcomes.met.tolist(), outcomes.part.tolist(), outcomes.left.tolist())
    assert list(zip(*result, strict=True)) == expected
    assert 5 < outcomes.met.sum() < len(expected) < len(asked)


@pytest.mark.parametrize("were_present", [True, False])
def test_pairs_of_an_absent_robot_did_not_meet_and_those_of_one_that_left_are_unknown(
    were_present: bool,
) -> None:
    # robot 0 was heard until 3 s; with 1 it met at 2 s, with 2 it did not; 2 and 3 go on
    every = pairs((0, 1), (0, 2), (2, 3))
    every["started_s"][0], every["last_within_s"][0] = NOW_S + 2.0, NOW_S + 2.5
    questions, heard = OpenQuestions(horizon_s=10.0), NOW_S + np.array([3.0, 6.0, 6.0, 6.0])
    questions.ask(NOW_S, every["code"], every["features"])
    questions.resolve_left(np.array([0]), every, heard_until(heard), were_present=were_present)
    (known,) = questions.answered(NOW_S + 7, every, heard_until(heard))
    assert slots_of(known.code)[1].tolist() == [1, 2]
    assert known.interacted.met.tolist() == known.touched.met.tolist() == [True, False]
    assert known.interacted.part.tolist() == [2, 3 if were_present else STAYED]
    assert known.interacted.left.tolist() == [False, were_present]
    # by contact it counts as it always did
    assert known.touched.left.tolist() == [False, True]
    # another robot has the slot by the time that the others are known
    (known,) = questions.answered(NOW_S + 16, every, heard_until(heard + 10.0))
    assert slots_of(known.code)[0].tolist() == [2]
