"""A situation counts under the kind that it was raised with, until it is cleared."""

from deconflict.advisories.situations.situation_counts import SituationCounts
from deconflict_client.advisory import AdvisoryState
from ingest.measures.measures import Measures
from tests.helpers.made_advisories import situation


def test_what_is_raised_and_what_is_cleared_of_a_kind_can_be_compared() -> None:
    measures, counts = Measures(), SituationCounts()
    raised = situation(1, situation_kind="meeting")
    updated = raised.model_copy(update={"situation_kind": "knot", "state": AdvisoryState.UPDATED})
    cleared = updated.model_copy(update={"state": AdvisoryState.CLEARED})
    counts.count(measures, [raised])
    counts.count(measures, [updated, cleared])
    assert measures.values["deconflict_situations_total"] == {
        ("meeting", "raised"): 1,
        ("meeting", "updated"): 1,
        ("meeting", "cleared"): 1,
    }


def test_after_a_restart_it_counts_under_the_kind_that_it_has_then() -> None:
    measures, counts = Measures(), SituationCounts()
    now_open = situation(1, situation_kind="knot", state=AdvisoryState.UPDATED)
    counts.restore([now_open])
    counts.count(measures, [now_open.model_copy(update={"situation_kind": "meeting", "state": AdvisoryState.CLEARED})])
    assert measures.values["deconflict_situations_total"] == {("knot", "cleared"): 1}
