"""Mend a report whose types are wrong but whose meaning is plain; each mend is a rule of `ingest/conformance.py`."""

from collections.abc import Iterable
from math import isfinite
from typing import Any

from ingest.reports import Extent, IdentityReport, PredictedLocation, Quaternion, Report, StatusReport, Velocity

_OBJECTS: dict[str, type[Report]] = {
    "location": PredictedLocation,
    "path": PredictedLocation,
    "destinations": PredictedLocation,
    "angle": Quaternion,
    "angular": Quaternion,
    "velocity": Velocity,
    "baseRobotEnvelope": Extent,
    "cargoMaxVolume": Extent,
}
_LISTS = ("path", "destinations", "errorCodes")
_NUMBERS = frozenset(
    (
        "x",
        "y",
        "z",
        "w",
        "linear",
        "maxSpeed",
        "maxRunTime",
        "batteryPercentage",
        "remainingRunTime",
        "loadPercentageStillAvailable",
    )
)
_NO_ANGLE = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0}
LOAD_USED_KEYS = ("loadPercentageUsed", "loadPercentage")


def mend(told: dict[str, Any], *, status: bool) -> tuple[Iterable[str], dict[str, Any]]:
    """The rules that were broken, and the report as it was meant. `told` is left as it was."""
    noted: dict[str, None] = {}
    mended = _object(told, (StatusReport if status else IdentityReport).model_fields, noted)
    if status:
        _mend_load(mended, noted)
    return noted, mended


def _object(told: dict[str, Any], known: Iterable[str], noted: dict[str, None]) -> dict[str, Any]:
    mended: dict[str, Any] = {}
    for key, value in told.items():
        if value is None:
            noted["null-value"] = None
        else:
            mended[key] = _value(key, value, noted) if key in known else value
    if "angle" in known and "angle" not in mended:
        noted["angle-missing"] = None
        mended["angle"] = _NO_ANGLE
    return mended


def _value(key: str, value: Any, noted: dict[str, None]) -> Any:
    if key in _LISTS:
        if not isinstance(value, list):
            noted["single-not-list"] = None
            value = [value]
        if key == "errorCodes":
            return [_text(one, noted) for one in value]
        return [_object(one, _OBJECTS[key].model_fields, noted) if isinstance(one, dict) else one for one in value]
    if key in _OBJECTS:
        return _object(value, _OBJECTS[key].model_fields, noted) if isinstance(value, dict) else value
    return _number(value, noted) if key in _NUMBERS else _text(value, noted)


def _number(value: Any, noted: dict[str, None]) -> Any:
    if not isinstance(value, str):
        return value
    try:
        number = float(value)
    except ValueError:
        return value
    if isfinite(number):
        noted["number-as-text"] = None
    return number


def _text(value: Any, noted: dict[str, None]) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return value
    noted["text-as-number"] = None
    return str(value)


def _mend_load(mended: dict[str, Any], noted: dict[str, None]) -> None:
    for key in LOAD_USED_KEYS:
        used = _number(mended.get(key), noted)
        if isinstance(used, int | float) and "loadPercentageStillAvailable" not in mended:
            noted["load-used-key"] = None
            mended["loadPercentageStillAvailable"] = 100.0 - used
