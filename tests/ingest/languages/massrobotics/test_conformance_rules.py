from pathlib import Path

import pytest

from ingest.languages.massrobotics.conformance_rules import CHAPTERS, RULES, page
from ingest.languages.rules import Rule
from tests.helpers.vectors import VECTORS

PAGE = Path(__file__).parents[4] / "docs" / "conformance.md"


def test_the_page_of_conformance_rules_is_up_to_date() -> None:
    assert PAGE.read_text() == page(), (
        "write it again: python -m ingest.languages.massrobotics.conformance_rules > docs/conformance.md"
    )


def test_a_code_names_one_rule() -> None:
    assert len(RULES) == sum(map(len, CHAPTERS.values()))


@pytest.mark.parametrize("rule", RULES.values(), ids=lambda rule: rule.code)
def test_a_rule_has_a_code_for_labels_and_a_sentence(rule: Rule) -> None:
    assert rule.code == "-".join(keyword for keyword in rule.code.lower().split("-") if keyword.isalnum())
    assert rule.sentence[0].isupper()
    assert rule.sentence[-1] == "."


@pytest.mark.parametrize("code", [rule.code for rule in RULES.values() if rule.alone])
def test_a_rule_that_one_message_shows_has_a_vector(code: str) -> None:
    assert any(code == vector.rejected or code in vector.findings for vector in VECTORS)


def test_no_vector_claims_a_rule_that_takes_more_than_a_message() -> None:
    claimed = {code for vector in VECTORS for code in (vector.rejected, *vector.findings) if code}
    assert claimed <= {rule.code for rule in RULES.values() if rule.alone}
