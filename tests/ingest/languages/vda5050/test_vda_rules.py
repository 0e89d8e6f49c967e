import pytest

from ingest.languages.model import Rejection
from ingest.languages.vda5050.vda_rules import RULES
from tests.helpers.vda_vectors import VECTORS, VdaVector
from tests.ingest.languages.vda5050.made_vda import Listener


@pytest.mark.parametrize("vector", VECTORS, ids=lambda each: each.rejected or " ".join(each.findings) or each.kind)
def test_a_message_breaks_the_rules_of_its_vector(vector: VdaVector) -> None:
    message = Listener().hears(vector.kind, vector.raw)
    assert isinstance(message, Rejection) == bool(vector.rejected)
    if isinstance(message, Rejection):
        assert message.rule == vector.rejected
        assert message.reason
    assert sorted(message.findings) == sorted(vector.findings)


@pytest.mark.parametrize("code", [rule.code for rule in RULES.values() if rule.alone])
def test_a_rule_that_one_message_shows_has_a_vector(code: str) -> None:
    assert any(code == vector.rejected or code in vector.findings for vector in VECTORS)


def test_no_vector_claims_a_rule_that_takes_more_than_a_message() -> None:
    claimed = {code for vector in VECTORS for code in (vector.rejected, *vector.findings) if code}
    assert claimed <= {rule.code for rule in RULES.values() if rule.alone}
