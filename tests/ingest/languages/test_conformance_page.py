from pathlib import Path

import pytest

from ingest.languages.conformance_page import page
from ingest.languages.front_ends import FRONT_ENDS
from ingest.languages.rules import Rule

PAGE = Path(__file__).parents[3] / "docs" / "conformance.md"
RULES = {f"{name}: {code}": rule for name, each in FRONT_ENDS.items() for code, rule in each.rules.items()}


def test_the_page_of_conformance_rules_is_up_to_date() -> None:
    wanted = "write it again: python -m ingest.languages.conformance_page > docs/conformance.md"
    assert PAGE.read_text() == page(), wanted


@pytest.mark.parametrize("language", FRONT_ENDS)
def test_a_code_names_one_rule_of_a_language(language: str) -> None:
    assert len(FRONT_ENDS[language].rules) == sum(map(len, FRONT_ENDS[language].chapters.values()))


@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
def test_a_rule_has_a_code_for_labels_and_a_sentence(rule: Rule) -> None:
    assert rule.code == "-".join(keyword for keyword in rule.code.lower().split("-") if keyword.isalnum())
    assert rule.sentence[0].isupper()
    assert rule.sentence[-1] == "."


def test_a_code_rejects_in_all_languages_or_in_none() -> None:
    for front_end in FRONT_ENDS.values():
        for code, rule in front_end.rules.items():
            assert all(each.rules[code].rejects == rule.rejects for each in FRONT_ENDS.values() if code in each.rules)
