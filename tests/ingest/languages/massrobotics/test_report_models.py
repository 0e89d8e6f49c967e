import pytest
from pydantic import ValidationError

from ingest.languages.massrobotics.json_objects import Quaternion
from ingest.languages.massrobotics.report_models import IdentityReport, StatusReport
from tests.helpers.vectors import named, said

REQUIRED = {
    IdentityReport: {
        "uuid",
        "timestamp",
        "manufacturerName",
        "robotModel",
        "robotSerialNumber",
        "baseRobotEnvelope",
    },
    StatusReport: {"uuid", "timestamp", "operationalState", "location"},
}


@pytest.mark.parametrize("model", REQUIRED)
def test_exactly_the_keys_the_standard_requires_are_required(model: type[IdentityReport | StatusReport]) -> None:
    assert {name for name, field_info in model.model_fields.items() if field_info.is_required()} == REQUIRED[model]


@pytest.mark.parametrize("number", [b"NaN", b"Infinity", b"1e999", b'"1"', b"true"])
def test_only_finite_numbers_are_numbers(number: bytes) -> None:
    with pytest.raises(ValidationError):
        Quaternion.model_validate_json(b'{"x": 0, "y": 0, "z": 0, "w": ' + number + b"}")


def test_a_key_of_the_senders_own_is_kept_aside() -> None:
    assert StatusReport.model_validate_json(said(mood="good")).model_extra == {"mood": "good"}
    assert IdentityReport.model_validate_json(named()).model_extra == {}
