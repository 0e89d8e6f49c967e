"""A pass revises a bounded number of conflicts for two vendors, the most urgent first; the others follow."""

from deconflict.advisories.conflict_lifecycle import ConflictLifecycle
from deconflict.advisories.revision_budget import MOST_REVISIONS, REVISIONS_PER_S, RevisionBudget
from deconflict.foresight.conflict_predictions import Prediction
from deconflict.settings.site import Conflict
from ingest.batch import Pair
from tests.helpers.made_predictions import in_columns
from tests.helpers.made_scene import MadeScene

NOW_S = 1000.0
OTHERS: tuple[Pair, ...] = (("a0", "c0"), ("c1", "c2"))
CROWD: tuple[Pair, ...] = tuple((f"a{n:03}", f"b{n:03}") for n in range(2 * MOST_REVISIONS))


class Vendors(MadeScene):
    """The vendor of a robot is the first letter of its UUID."""

    def account(self, uuid: str) -> str:
        return uuid[0]


def predicted(pairs: tuple[Pair, ...]) -> list[Prediction]:
    """Later pairs meet earlier."""
    return [Prediction(pair, NOW_S + 9 - n / 100, 0.0, 5.0, fresh=True) for n, pair in enumerate(pairs)]


def test_the_conflicts_of_two_vendors_beyond_the_budget_wait_and_those_of_others_do_not() -> None:
    lifecycle, scene = ConflictLifecycle(Conflict(evident_probability=0.5), 60.0), Vendors()
    predictions = in_columns(sorted(predicted(CROWD + OTHERS)))
    raised = {advisory.robots for advisory in lifecycle.revise(NOW_S, predictions, set(), scene)}
    assert raised == {*CROWD[-MOST_REVISIONS:], *OTHERS}
    assert lifecycle.budget.deferred == {"a": MOST_REVISIONS, "b": MOST_REVISIONS}
    later = lifecycle.revise(NOW_S + 0.1, predictions, set(), scene)
    assert {(advisory.robots, advisory.encounter) for advisory in later} == {
        (pair, 1) for pair in CROWD[:-MOST_REVISIONS]
    }
    assert not lifecycle.budget.deferred


def test_a_budget_holds_for_two_vendors_in_any_order() -> None:
    budget = RevisionBudget()
    budget.begin_pass(NOW_S, lambda uuid: uuid[0])
    for n in range(MOST_REVISIONS):
        assert budget.admits(("a1", "b1"))
        budget.spend(("a1", "b1") if n % 2 else ("b2", "a2"))
    assert not budget.admits(("b3", "a3"))
    assert budget.admits(("a1", "a2"))
    assert budget.deferred == {"a": 1, "b": 1}


def test_frequent_passes_make_no_more_revisions_a_second() -> None:
    budget, made, passes = RevisionBudget(), 0, 64
    for number in range(passes):
        budget.begin_pass(NOW_S + number / passes, lambda uuid: uuid[0])
        while budget.admits(("a1", "b1")):
            budget.spend(("a1", "b1"))
            made += 1
    assert 0 <= made - REVISIONS_PER_S <= MOST_REVISIONS
    budget.begin_pass(NOW_S + 10.0, lambda uuid: uuid[0])
    assert not budget.may_exceed(MOST_REVISIONS)
    assert budget.may_exceed(MOST_REVISIONS + 1)
