"""Repairs a report whose types are wrong but whose meaning is clear. Each repair is a rule of `conformance_rules`."""

from math import isfinite
from typing import Any

from pydantic import ValidationError

from ingest.languages.massrobotics.json_objects import Report, value_type
from ingest.languages.massrobotics.path_points import MOST_POINTS_USED
from ingest.languages.model import MOST_CODES
from ingest.languages.rules import Findings


def repaired(document: dict[str, Any], model: type[Report], findings: Findings) -> dict[str, Any]:
    """A copy of the report with values of the right types. A value whose meaning is not clear stays as it is."""
    known = model.model_fields
    copy: dict[str, Any] = {}
    for key, value in document.items():
        if value is None:
            findings["null-value"] = None
        else:
            copy[key] = _value(key, value, known[key].annotation, findings) if key in known else value
    return copy


def without_misfits(document: dict[str, Any], model: type[Report], findings: Findings) -> dict[str, Any]:
    """The report without the optional values and the points that do not fit `model`. Required values stay."""
    kept = dict(document)
    for key in _misfits(document, model):
        fitting = _fitting(document[key], model.model_fields[key].annotation, findings) if key in document else None
        if fitting is not None:
            kept[key] = fitting
        elif not model.model_fields[key].is_required():
            findings["value-unreadable"] = None
            del kept[key]
    return kept


def finite(value: Any) -> bool:
    """Whether every number in a JSON value is finite."""
    if isinstance(value, float):
        return isfinite(value)
    if isinstance(value, dict):
        return all(map(finite, value.values()))
    return not isinstance(value, list) or all(map(finite, value))


def _value(key: str, value: Any, annotation: Any, findings: Findings) -> Any:
    kind, is_list = value_type(annotation)
    if is_list:
        return _list(value, kind, findings)
    return _stamp(value) if key == "timestamp" else _item(value, kind, findings)


def _list(value: Any, kind: type, findings: Findings) -> list[Any]:
    if not isinstance(value, list):
        findings["single-not-list"] = None
        value = [value]
    if kind is str and len(value) > MOST_CODES:
        findings["codes-too-many"] = None
    value = value[: MOST_CODES if kind is str else MOST_POINTS_USED]
    if None in value:
        findings["null-value"] = None
    return [_item(item, kind, findings) for item in value if item is not None]


def _item(value: Any, kind: type, findings: Findings) -> Any:
    if issubclass(kind, Report):
        return repaired(value, kind, findings) if isinstance(value, dict) else value
    return number(value, findings) if kind is float else _text(value, findings)


def number(value: Any, findings: Findings) -> Any:
    """The number if the value is a text that spells one. Any other value stays as it is."""
    if not isinstance(value, str):
        return value
    try:
        parsed = float(value)
    except ValueError:
        return value
    findings["number-as-text"] = None
    return parsed


def _text(value: Any, findings: Findings) -> Any:
    if not is_number(value):
        return value
    findings["text-as-number"] = None
    return _digits(value)


def _stamp(value: Any) -> Any:
    """A time sent as a number becomes text, which `timestamps.parse` reads and counts."""
    return _digits(value) if is_number(value) else value


def is_number(value: Any) -> bool:
    """Whether a JSON value is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and finite(value)


def _digits(value: float) -> str:
    return str(int(value)) if isinstance(value, int) or value.is_integer() else repr(value)


def _misfits(value: dict[str, Any], model: type[Report]) -> list[str]:
    """Keys whose values do not fit the model, and required keys that are missing."""
    try:
        model.model_validate(value)
    except ValidationError as error:
        errors = error.errors(include_url=False, include_context=False, include_input=False)
        return list(dict.fromkeys(str(misfit["loc"][0]) for misfit in errors))
    return []


def _fitting(value: Any, annotation: Any, findings: Findings) -> Any:
    """The part of a value that fits. None if nothing can be kept."""
    kind, is_list = value_type(annotation)
    if not issubclass(kind, Report):
        if not is_list:
            return None
        findings["value-unreadable"] = None
        return [text for text in value if isinstance(text, str)]
    if not is_list:
        return _fitting_object(value, kind, findings)
    fitting = (_fitting_object(point, kind, findings) for point in value[:MOST_POINTS_USED])
    points = [point for point in fitting if point is not None]
    if len(points) < min(len(value), MOST_POINTS_USED):
        findings["point-unreadable"] = None
    return points


def _fitting_object(value: Any, model: type[Report], findings: Findings) -> dict[str, Any] | None:
    if not isinstance(value, dict):
        return None
    kept = without_misfits(value, model, findings)
    return None if _misfits(kept, model) else kept
