"""One message: bytes in; an identity, a status or a counted rejection out. Never raises on what a sender sent.

A conforming message is decoded at once. A message with keys of its own is validated from its bytes. A message that does
not validate is parsed, repaired where its meaning is clear, and validated again; then optional values that still do not
fit are left out. Of duplicate keys the last one holds.
"""

import json
from collections.abc import Sequence
from math import isnan, nan
from typing import Any, cast

from pydantic import ValidationError
from pydantic_core import from_json

from ingest.languages.massrobotics import fast_decoder, path_points, repair, timestamps, vocabulary
from ingest.languages.massrobotics.conformance_rules import Findings, RejectedError
from ingest.languages.massrobotics.report_models import (
    Extent,
    IdentityReport,
    Location,
    PredictedLocation,
    Quaternion,
    Report,
    StatusReport,
    Velocity,
)
from ingest.languages.model import Identity, Path, Rejection, Status

__all__ = ["Identity", "Path", "Rejection", "Status", "document", "read", "rejection"]

MAX_ENVELOPE_M = 100.0
MAX_SPEED_MPS = 100.0
MAX_REASON = 300
MAX_TEXT = 100
HOUR_S = 3600.0
"""Letters kept of a name: it is in every batch and advisory of its robot."""
BYTE_ORDER_MARK = b"\xef\xbb\xbf"
LOAD_USED_KEY = "loadPercentageUsed"
"""A key after the text of the standard (5.3.4), whose schema asks for what is still available."""
_IDENTITY_KEYS = frozenset(("baseRobotEnvelope", "manufacturerName", "robotModel", "robotSerialNumber"))
_STATUS_KEYS = frozenset(("operationalState", "location"))
_HOLDERS = {
    IdentityReport: ("baseRobotEnvelope", "cargoMaxVolume"),
    StatusReport: ("location", "velocity", "path", "destinations"),
    Location: ("angle",),
    PredictedLocation: ("angle",),
    Velocity: ("angular",),
    Extent: (),
    Quaternion: (),
}
"""What of each report is a report in its turn."""


def read(raw: bytes, *, names_as_uuid: str | None = None) -> Identity | Status | Rejection:
    """What one message says. `names_as_uuid` is the vendor whose robots may go by name instead of a UUID."""
    findings: Findings = {}
    sent_uuid: object = None
    try:
        report = fast_decoder.decoded(raw) or _report(raw, findings)
        sent_uuid = report.uuid
        uuid = vocabulary.robot_uuid(report.uuid, names_as_uuid, findings)
        if fast_decoder.is_status(report):
            return _status(report, uuid, findings)
        return _identity(cast(IdentityReport, report), uuid, findings)
    except RejectedError as rejected:
        return rejection(rejected, sent_uuid, names_as_uuid, findings)


def rejection(rejected: RejectedError, sent_uuid: object, names_as_uuid: str | None, findings: Findings) -> Rejection:
    """A rejected message, with its robot where the UUID that was sent can be read."""
    uuid = _uuid_if_read(rejected.said_uuid or sent_uuid, names_as_uuid)
    return Rejection(rejected.rule, rejected.reason[:MAX_REASON], uuid, tuple(findings))


def document(raw: bytes) -> dict[str, Any]:
    """Everything an accepted message said, JSON-ready, spelt and keyed as the standard does, unknown keys included.

    Times are in UTC. Raises `RejectedError` for a message that `read` rejects.
    """
    report = _report(raw, {})
    told = report.model_dump(mode="json", exclude_none=True)
    if vocabulary.is_uuid(report.uuid):
        told["uuid"] = vocabulary.robot_uuid(report.uuid, None, {})
    told["timestamp"] = timestamps.write(_stamp(report.timestamp, {}).t_s)
    if isinstance(report, StatusReport):
        _spell_status(told, report)
    elif report.maxRunTime is not None:
        told["maxRunTime"] = _run_time(report.maxRunTime, {})
    return told


def _spell_status(told: dict[str, Any], report: StatusReport) -> None:
    told["operationalState"] = vocabulary.state(report.operationalState, {})[0]
    amounts = {
        "batteryPercentage": _share(report.batteryPercentage, "battery-out-of-range", {}),
        "loadPercentageStillAvailable": _load_available(report, {}),
        "remainingRunTime": _run_time(report.remainingRunTime, {}),
    }
    told.update((key, amount) for key, amount in amounts.items() if amount is not None)
    _spell_datum(told["location"], "planarDatum")
    for point in (*told.get("path", ()), *told.get("destinations", ())):
        _spell_datum(point, "planarDatumUUID")
        stamp = timestamps.parse(point["timestamp"])
        if stamp and timestamps.plausible(stamp.t_s):
            point["timestamp"] = timestamps.write(stamp.t_s)


def _spell_datum(location: dict[str, Any], key: str) -> None:
    """Put the datum, in lower case, where the schema has it."""
    keys = (key, *({"planarDatum", "planarDatumUUID"} - {key}))
    said = [location.pop(each) for each in keys if each in location]
    if said:
        location[key] = vocabulary.datum(said[0], None, {}, empty="datum-empty")


def _report(raw: bytes, findings: Findings) -> IdentityReport | StatusReport:
    if b"null" not in raw:
        try:
            return (StatusReport if b'"operationalState"' in raw else IdentityReport).model_validate_json(raw)
        except ValidationError:
            pass
    return _mended(raw, findings)


def _mended(raw: bytes, findings: Findings) -> IdentityReport | StatusReport:
    told = _parsed(raw, findings)
    model = _model(told)
    mended = repair.mend(told, model, findings)
    try:
        return model.model_validate(mended)
    except ValidationError:
        if not repair.finite(mended):
            reason = "a number is NaN, infinite or too large; leave out what is not known"
            raise RejectedError("number-not-finite", reason, told.get("uuid")) from None
    try:
        return model.model_validate(repair.without_misfits(mended, model, findings))
    except ValidationError as error:
        errors = error.errors(include_url=False, include_context=False, include_input=False)
        reasons = (f"{'.'.join(map(str, one['loc']))[:60]}: {one['msg'][:80]}" for one in errors[:2])
        rule = "key-missing" if errors[0]["type"] == "missing" else "type-wrong"
        raise RejectedError(rule, "; ".join(reasons), told.get("uuid")) from None


def _parsed(raw: bytes, findings: Findings) -> dict[str, Any]:
    if raw.startswith(BYTE_ORDER_MARK):
        findings["byte-order-mark"] = None
        raw = raw.removeprefix(BYTE_ORDER_MARK)
    try:
        told = from_json(raw)
    except ValueError as error:
        raise _unparsed(raw, str(error)) from None
    if not isinstance(told, dict):
        raise RejectedError("not-object", f"JSON {_KINDS[type(told)]}; send one JSON object a message")
    return told


_KINDS = {
    list: "array",
    str: "string",
    bool: "true or false",
    int: "number",
    float: "number",
    type(None): "null",
}


def _unparsed(raw: bytes, why: str) -> RejectedError:
    try:
        raw.decode()
    except UnicodeDecodeError as broken:
        return RejectedError("not-utf8", f"byte {broken.start} is not UTF-8; send JSON text in UTF-8")
    if why.startswith("recursion limit"):
        return RejectedError("too-deep", f"{why}; no report nests so deep")
    return RejectedError("not-json", f"{why}; send one JSON object a message")


def _model(told: dict[str, Any]) -> type[IdentityReport | StatusReport]:
    if told.keys() & _STATUS_KEYS:
        return StatusReport
    if told.keys() & _IDENTITY_KEYS:
        return IdentityReport
    shown = json.dumps([key[:30] for key in sorted(told)[:5]])
    reason = f"keys {shown} are of neither an identity report nor a status report"
    raise RejectedError("report-unknown", reason, told.get("uuid"))


def _uuid_if_read(said: object, names_as_uuid: str | None) -> str | None:
    try:
        return vocabulary.robot_uuid(said, names_as_uuid, {}) if isinstance(said, str) else None
    except RejectedError:
        return None


def _identity(report: IdentityReport, uuid: str, findings: Findings) -> Identity:
    stamp = _stamp(report.timestamp, findings)
    _note_extras(report, findings)
    size = report.baseRobotEnvelope
    if size.x <= 0 or size.y <= 0 or size.z < 0:
        raise RejectedError("envelope-not-positive", f"baseRobotEnvelope is {size.x:g} x {size.y:g} m; send its size")
    if max(size.x, size.y, size.z) > MAX_ENVELOPE_M:
        reason = f"baseRobotEnvelope is {size.x:g} x {size.y:g} x {size.z:g}; send metres"
        raise RejectedError("envelope-absurd", reason)
    texts = (report.manufacturerName, report.robotModel, report.robotSerialNumber)
    if not all(text.strip() for text in texts):
        findings["text-empty"] = None
    if max(map(len, texts)) > MAX_TEXT:
        findings["text-too-long"] = None
    _run_time(report.maxRunTime, findings)
    max_speed_mps = _speed(report.maxSpeed, findings)
    if max_speed_mps is not None and max_speed_mps <= 0:
        findings["speed-limit-not-positive"] = None
        max_speed_mps = None
    return Identity(
        uuid=uuid,
        stamp_s=stamp.t_s,
        manufacturer=report.manufacturerName[:MAX_TEXT],
        model=report.robotModel[:MAX_TEXT],
        serial=report.robotSerialNumber[:MAX_TEXT],
        envelope_m=(size.x, size.y, size.z),
        max_speed_mps=max_speed_mps,
        findings=tuple(findings),
    )


def _status(report: StatusReport, uuid: str, findings: Findings) -> Status:
    stamp = _stamp(report.timestamp, findings)
    here = report.location
    if path_points.absurd(here.x, here.y, here.z):
        reason = f"location {here.x:g}, {here.y:g}, {here.z:g} is off any floor; send metres on the datum"
        raise RejectedError("position-absurd", reason)
    _note_extras(report, findings)
    state, known_state = vocabulary.state(report.operationalState, findings)
    linear_mps, turn_rad_per_s = _velocity(report.velocity, findings)
    available_pct = _load_available(report, findings)
    run_time_left_h = _run_time(report.remainingRunTime, findings)
    return Status(  # in order, which costs a sixth of naming each
        uuid,
        stamp.t_s,
        stamp.resolution_s,
        state,
        known_state,
        here.x,
        here.y,
        here.z,
        path_points.yaw_rad(here.angle, findings),
        vocabulary.datum(here.planarDatum, here.planarDatumUUID, findings, empty="datum-missing"),
        linear_mps,
        turn_rad_per_s,
        None if available_pct is None else 100.0 - available_pct,
        _battery(report.batteryPercentage, findings),
        None if run_time_left_h is None else run_time_left_h * HOUR_S,
        _error_codes(report.errorCodes, findings) if report.errorCodes else (),
        path_points.destinations(report.destinations, stamp.t_s, findings),
        path_points.path(report.path, stamp.t_s, findings),
        tuple(findings),
    )


def _stamp(text: str, findings: Findings) -> timestamps.Stamp:
    stamp = timestamps.parse(text)
    if stamp is None:
        raise RejectedError("stamp-unreadable", f"timestamp {text[:60]!r} is no RFC 3339 date-time in UTC")
    if not timestamps.plausible(stamp.t_s):
        raise RejectedError("stamp-absurd", f"timestamp {text[:60]!r} lies outside 1970 to 2100")
    if stamp.findings:
        findings.update(dict.fromkeys(stamp.findings))
    return stamp


def _note_extras(report: Report, findings: Findings) -> None:
    """Keys of the sender's own, in the report or in any part of it. A decoded report has none."""
    extra = report.__pydantic_extra__
    if extra is None:
        return
    if not repair.finite(extra):
        raise RejectedError("number-not-finite", f"{_first(extra)} holds NaN or an infinite number; leave it out")
    if extra.keys() - {LOAD_USED_KEY}:
        findings["key-unknown"] = None
    for name in _HOLDERS[type(report)]:
        held = getattr(report, name)
        for part in held if isinstance(held, list) else (held,):
            if part is not None:
                _note_extras(part, findings)


def _first(extra: dict[str, Any]) -> str:
    return repr(next(key for key, value in extra.items() if not repair.finite(value))[:60])


def _velocity(velocity: Velocity | None, findings: Findings) -> tuple[float | None, float | None]:
    """Speed along the heading, and the turn made in one second; None where not sent."""
    if velocity is None:
        return None, None
    turn_rad = path_points.yaw_rad(velocity.angular, findings) if velocity.angular else nan
    return _speed(velocity.linear, findings), None if isnan(turn_rad) else turn_rad


def _speed(speed_mps: float | None, findings: Findings) -> float | None:
    if speed_mps is None or abs(speed_mps) <= MAX_SPEED_MPS:
        return speed_mps
    findings["speed-absurd"] = None
    return None


def _battery(battery_pct: float | None, findings: Findings) -> float | None:
    if battery_pct is not None and 0.0 < battery_pct < 1.0:
        findings["battery-fraction"] = None
    return _share(battery_pct, "battery-out-of-range", findings)


def _load_available(report: StatusReport, findings: Findings) -> float | None:
    available_pct = report.loadPercentageStillAvailable
    extra = report.__pydantic_extra__
    if extra and LOAD_USED_KEY in extra:
        findings["load-used-key"] = None
        used_pct = repair.number(extra[LOAD_USED_KEY], findings)
        if available_pct is None and repair.is_number(used_pct):
            available_pct = 100.0 - used_pct
    return _share(available_pct, "load-out-of-range", findings)


def _share(value_pct: float | None, rule: str, findings: Findings) -> float | None:
    if value_pct is None or 0.0 <= value_pct <= 100.0:
        return value_pct
    findings[rule] = None
    return min(max(value_pct, 0.0), 100.0)


def _run_time(hours: float | None, findings: Findings) -> float | None:
    if hours is None or hours >= 0.0:
        return hours
    findings["run-time-negative"] = None
    return 0.0


def _error_codes(codes: Sequence[str], findings: Findings) -> tuple[str, ...]:
    if len(set(codes)) < len(codes):
        findings["duplicate-items"] = None
    if not all(code.strip() for code in codes):
        findings["text-empty"] = None
    return tuple(code for code in codes if code.strip())
