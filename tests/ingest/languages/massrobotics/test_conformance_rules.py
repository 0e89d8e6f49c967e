import pytest

from ingest.languages.massrobotics.conformance_rules import RULES
from tests.helpers.vectors import VECTORS


@pytest.mark.parametrize("code", [rule.code for rule in RULES.values() if rule.alone])
def test_a_rule_that_one_message_shows_has_a_vector(code: str) -> None:
    assert any(code == vector.rejected or code in vector.findings for vector in VECTORS)


def test_no_vector_claims_a_rule_that_takes_more_than_a_message() -> None:
    claimed = {code for vector in VECTORS for code in (vector.rejected, *vector.findings) if code}
    assert claimed <= {rule.code for rule in RULES.values() if rule.alone}
