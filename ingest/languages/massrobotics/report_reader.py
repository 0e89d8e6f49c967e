"""From the bytes of a message to a validated report of the standard.

A conforming message is decoded at once. A message with keys that the standard does not have is validated from its
bytes. A message that does not validate is parsed, repaired where its meaning is clear, and validated again. Then
optional values that still do not fit are left out. Of duplicate keys the last one holds.
"""

import json
from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError
from pydantic_core import from_json

from ingest.languages.massrobotics import fast_decoder, repair
from ingest.languages.massrobotics.report_models import IdentityReport, StatusReport
from ingest.languages.rules import Findings, RejectedError

BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_IDENTITY_KEYS = frozenset(("baseRobotEnvelope", "manufacturerName", "robotModel", "robotSerialNumber"))
_STATUS_KEYS = frozenset(("operationalState", "location"))
EXPECTED = {
    "missing": "is missing",
    "float_type": "expected a number",
    "float_parsing": "expected a number",
    "int_type": "expected a whole number",
    "string_type": "expected text",
    "bool_type": "expected true or false",
    "list_type": "expected an array",
    "tuple_type": "expected an array",
    "model_type": "expected an object",
    "dict_type": "expected an object",
    "finite_number": "expected a finite number",
}
"""What is said to be wrong with a value, by the kind of pydantic's error."""
_JSON_KINDS = {
    list: "array",
    str: "string",
    bool: "true or false",
    int: "number",
    float: "number",
    type(None): "null",
}


def decoded_report(raw: bytes, findings: Findings) -> IdentityReport | StatusReport:
    """The report of a message. It may be a struct of `fast_decoder` with the same attributes.

    Raises `RejectedError` for a message that can't be understood.
    """
    return fast_decoder.decoded(raw) or validated_report(raw, findings)


def validated_report(raw: bytes, findings: Findings) -> IdentityReport | StatusReport:
    """The report of a message as a pydantic model, unknown keys included.

    Raises `RejectedError` for a message that can't be understood.
    """
    if b"null" not in raw:
        try:
            return (StatusReport if b'"operationalState"' in raw else IdentityReport).model_validate_json(raw)
        except ValidationError:
            pass
    return _repaired_report(raw, findings)


def _repaired_report(raw: bytes, findings: Findings) -> IdentityReport | StatusReport:
    document = _parsed(raw, findings)
    model = _model(document)
    repaired = repair.repaired(document, model, findings)
    try:
        return model.model_validate(repaired)
    except ValidationError:
        if not repair.finite(repaired):
            reason = "a number is NaN, infinite or too large; leave out what is not known"
            raise RejectedError("number-not-finite", reason, document.get("uuid")) from None
    try:
        return model.model_validate(repair.without_misfits(repaired, model, findings))
    except ValidationError as error:
        errors = error.errors(include_url=False, include_context=False, include_input=False)
        reasons = (f"{'.'.join(map(str, misfit['loc']))[:60]}: {_plain(misfit)}" for misfit in errors[:2])
        rule = "key-missing" if errors[0]["type"] == "missing" else "type-wrong"
        raise RejectedError(rule, "; ".join(reasons), document.get("uuid")) from None


def _plain(misfit: Mapping[str, Any]) -> str:
    """What is wrong with a value, in the words of the standard's schema."""
    return (
        EXPECTED.get(misfit["type"]) or misfit["msg"].removeprefix("Input should be ").replace("Value error, ", "")[:80]
    )


def _parsed(raw: bytes, findings: Findings) -> dict[str, Any]:
    if raw.startswith(BYTE_ORDER_MARK):
        findings["byte-order-mark"] = None
        raw = raw.removeprefix(BYTE_ORDER_MARK)
    try:
        document = from_json(raw)
    except ValueError as error:
        raise _not_parsed(raw, str(error)) from None
    if not isinstance(document, dict):
        raise RejectedError("not-object", f"JSON {_JSON_KINDS[type(document)]}; send one JSON object a message")
    return document


def _not_parsed(raw: bytes, why: str) -> RejectedError:
    try:
        raw.decode()
    except UnicodeDecodeError as broken:
        return RejectedError("not-utf8", f"byte {broken.start} is not UTF-8; send JSON text in UTF-8")
    what, _, place = why.partition(" at ")
    if what.startswith("recursion limit"):
        return RejectedError("too-deep", f"nests deeper than any report, at {place}")
    what = what.replace("EOF while parsing", "it ends within").replace("expected ident", "expected a value")
    return RejectedError("not-json", f"{what} at {place}; send one JSON object a message")


def _model(document: dict[str, Any]) -> type[IdentityReport | StatusReport]:
    if document.keys() & _STATUS_KEYS:
        return StatusReport
    if document.keys() & _IDENTITY_KEYS:
        return IdentityReport
    shown = json.dumps([key[:30] for key in sorted(document)[:5]])
    reason = f"keys {shown} are of neither an identity report nor a status report"
    raise RejectedError("report-unknown", reason, document.get("uuid"))
