"""From the bytes of a message to a validated report of the standard.

A conforming message is decoded at once. A message with keys that the standard does not have is validated from its
bytes. A message that does not validate is parsed, repaired where its meaning is clear, and validated again. Of
duplicate keys the last one holds.
"""

import json
from collections.abc import Iterator, Mapping
from functools import cache, reduce
from itertools import chain
from operator import getitem
from typing import Any

from pydantic import ValidationError

from ingest.languages.massrobotics import fast_decoder
from ingest.languages.massrobotics.fast_decoder import struct_of
from ingest.languages.massrobotics.json_objects import Extent, Report, value_type
from ingest.languages.massrobotics.path_points import MOST_POINTS_USED
from ingest.languages.massrobotics.report_models import IdentityReport, StatusReport
from ingest.languages.rules import Findings, RejectedError
from ingest.languages.tolerance.nesting import moved, unwrapped
from ingest.languages.tolerance.spelling import PLACE_NAMES, folded, nearest
from ingest.languages.tolerance.tolerant_json import parsed
from ingest.languages.tolerance.value_kinds import object_kind
from ingest.languages.tolerance.value_reader import ValueReader, is_number

NAMES_OF_THE_TEXT: dict[str, tuple[str, ...]] = dict.fromkeys(PLACE_NAMES, ("location",)) | {
    "pose": ("location", "angle"),
    "posequaternion": ("angle",),
    "posequaternions": ("angle",),
    "quaternion": ("angle",),
    "qx": ("x",),
    "qy": ("y",),
    "qz": ("z",),
    "qw": ("w",),
    "planardatumid": ("planarDatum",),
    "nextworkinglocation": ("destinations",),
    "nextworkinglocations": ("destinations",),
    "errorcode": ("errorCodes",),
    "estimatedremainingruntime": ("remainingRunTime",),
    "cargocapacityvolumelimit": ("cargoMaxVolume",),
    "cargocapacityweightlimit": ("cargoMaxWeight",),
    "visualthumbnailimage": ("thumbnailImage",),
    "linktoproductdocumentation": ("productDocumentation",),
}
"""Names of keys in the text of the standard, folded, and those of its schema, of which an object has one; and other
names of the location."""
NAMES_WITH_SIDES = NAMES_OF_THE_TEXT | {"length": ("x",), "width": ("y",), "height": ("z",)}
"""And other names of the sides of an envelope. A place has none: a height beside it is that of something else."""
NEEDED = frozenset(("linear",))
"""A key that the schema has as required, without which a velocity still says the rest."""
TEXTS = ("timestamp", "operationalState", "manufacturerName", "robotModel", "robotSerialNumber")
"""Required texts without which a report still says the rest."""


def repaired_document(document: dict[str, Any], model: type[Report], findings: Findings) -> dict[str, Any]:
    """A copy of the report with values of the right types, without those that can't be read.

    What the report can't do without stays as it is if it can't be read.
    """
    names, needed = _other_names(model), NEEDED
    reader = ValueReader(findings, names, needed=needed, keeps_others=True, most_items=MOST_POINTS_USED)
    read, _ = reader.read(document, object_kind(struct_of(model)))
    for key in TEXTS:
        if key in model.model_fields and not isinstance(read.get(key), str):
            if key not in read:
                findings.note("key-absent", key, None, "read as empty")
            read[key] = ""
    if model is IdentityReport and not _is_size(read.get("baseRobotEnvelope")):
        read["baseRobotEnvelope"] = {"x": 0.0, "y": 0.0}
    return read


def _is_size(envelope: Any) -> bool:
    return isinstance(envelope, dict) and all(is_number(envelope.get(side)) for side in "xy")


def _other_names(model: type[Any]) -> dict[str, tuple[str, ...]]:
    return NAMES_WITH_SIDES if model in (IdentityReport, Extent) else NAMES_OF_THE_TEXT


def meant_key(key: str, model: type[Report]) -> str:
    """The key that is meant by one which the schema spells otherwise. "" if the schema has none for it."""
    return object_kind(struct_of(model)).meant(folded(key), _other_names(model))


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
            report = (StatusReport if b'"operationalState"' in raw else IdentityReport).model_validate_json(raw)
        except ValidationError:
            pass
        else:
            if not _is_spelt_otherwise(report):
                return report
    return _repaired_report(raw, findings)


def _is_spelt_otherwise(report: Report) -> bool:
    """Whether a key that is absent stands in another spelling, or at another level, in the report or any part of it."""
    extra = report.__pydantic_extra__ or {}
    for key in extra:
        meant = meant_key(key, type(report))
        if meant and meant not in report.model_fields_set:
            return True
    kind = object_kind(struct_of(type(report)))
    sent = dict.fromkeys(report.model_fields_set) | extra
    if extra and any(True for _ in moved(sent, kind, NEEDED, _other_names(type(report)))):
        return True
    return any(_is_spelt_otherwise(part) for part, _ in parts_of(report))


def parts_of(report: Report) -> Iterator[tuple[Report, str]]:
    """The objects of the standard in a report, and where they stand in it."""
    for name in _parts(type(report)):
        value: Any = getattr(report, name)
        if isinstance(value, list):
            yield from ((part, f"{name}[{row}]") for row, part in enumerate(value))
        elif value is not None:
            yield value, name


@cache
def _parts(model: type[Report]) -> list[str]:
    """The keys of a report that hold objects of the standard."""
    return [name for name, field in model.model_fields.items() if issubclass(value_type(field.annotation)[0], Report)]


def _repaired_report(raw: bytes, findings: Findings) -> IdentityReport | StatusReport:
    document = parsed(raw, findings)
    model = _model(document)
    if model is None and (inner := unwrapped(document)) is not None:
        model = _model(inner)
        if model:
            findings.note("nested-otherwise", "", None, "its only object")
            document = inner
    if model is None:
        shown = json.dumps([key[:30] for key in sorted(document)[:5]])
        reason = f"keys {shown} are of neither an identity report nor a status report"
        raise RejectedError("report-unknown", reason, document.get("uuid"))
    repaired = repaired_document(document, model, findings)
    try:
        return model.model_validate(repaired)
    except ValidationError as error:
        errors = error.errors(include_url=False, include_context=False, include_input=False)
    if any(misfit["type"] == "finite_number" for misfit in errors):
        reason = "a required number is NaN, infinite or too large; leave out what is not known"
        raise RejectedError("number-not-finite", reason, repaired.get("uuid"))
    reasons = [_reason(misfit, repaired, findings) for misfit in errors[:2]]
    rule = "key-missing" if errors[0]["type"] == "missing" else "type-wrong"
    raise RejectedError(rule, "; ".join(reasons), repaired.get("uuid"))


def _reason(misfit: Mapping[str, Any], sent: dict[str, Any], findings: Findings) -> str:
    """What is wrong with a value, and if it is missing, the key that was probably meant for it."""
    *parents, key = misfit["loc"]
    wrong = f"{'.'.join(map(str, misfit['loc']))[:60]}: {_plain(misfit)}"
    if misfit["type"] != "missing":
        return wrong
    part: Any = reduce(getitem, parents, sent)
    found = next((other for other in part if nearest(other, frozenset((key,)))), None)
    if found is None:
        return wrong
    path = ".".join(map(str, [*parents, found]))
    findings.note("key-unknown", path, part[found], "not used", key)
    return f"{wrong}; {path[:60]}: did you mean {key}?"


def _plain(misfit: Mapping[str, Any]) -> str:
    """What is wrong with a value, in the words of the standard's schema."""
    return (
        EXPECTED.get(misfit["type"]) or misfit["msg"].removeprefix("Input should be ").replace("Value error, ", "")[:80]
    )


def _model(document: dict[str, Any]) -> type[IdentityReport | StatusReport] | None:
    models = (StatusReport, _STATUS_KEYS), (IdentityReport, _IDENTITY_KEYS)
    as_spelt = (model for model, keys in models if keys & document.keys())
    as_meant = (model for model, keys in models if any(meant_key(key, model) in keys for key in document))
    return next(chain(as_spelt, as_meant), None)
