"""Why advisories are cleared, as a code: programs decide by it, and not by its sentence."""

from deconflict.advisories.advisory_counts import count_revisions
from deconflict.advisories.finding_lifecycle import CLEARED_CODES
from deconflict_client.advisory import ADVISORY, ADVISORY_KINDS, ClearedCode
from ingest.measures.measures import Measures
from tests.helpers.made_advisories import START, cleared, made


def test_a_cleared_revision_has_the_code_and_its_sentence() -> None:
    over = made(1).cleared_revision(START.timestamp(), ClearedCode.PASSED)
    assert over.model_dump(mode="json")["cleared_code"] == "passed"
    assert over.cleared_because == "they have passed each other"
    assert ADVISORY.validate_json(over.model_dump_json()) == over


def test_a_revision_of_an_older_release_has_no_code() -> None:
    before = cleared(1).model_dump(mode="json")
    del before["cleared_code"]
    read = ADVISORY.validate_python(before)
    assert (read.cleared_code, read.cleared_because) == (None, "they passed")


def test_outcomes_are_counted_by_the_code_whatever_the_sentence_is() -> None:
    measures = Measures()
    met = made(1).cleared_revision(START.timestamp(), ClearedCode.PASSED, "sie sind aneinander vorbei")
    count_revisions(measures, [met, cleared(2, cleared_because="they have passed each other")])
    counts = {key: count for key, count in measures.values["deconflict_conflicts_ended_total"].items() if "Acme" in key}
    assert counts == {("Acme", "met"): 1, ("Acme", "left"): 1}


def test_every_kind_of_finding_has_a_code_of_its_own() -> None:
    assert CLEARED_CODES.keys() == ADVISORY_KINDS - {"conflict"}
    assert len(set(CLEARED_CODES.values())) == len(CLEARED_CODES)
