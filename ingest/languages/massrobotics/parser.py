"""One message in; an identity, a status or a rejection out. Never raises, whatever a sender sends."""

from collections.abc import Sequence
from functools import cache
from typing import Any, cast

from ingest.languages import timestamps
from ingest.languages.massrobotics import amounts, fast_decoder, path_points, repair, vocabulary
from ingest.languages.massrobotics.json_objects import Report, value_type
from ingest.languages.massrobotics.report_models import IdentityReport, StatusReport
from ingest.languages.massrobotics.report_reader import decoded_report
from ingest.languages.model import (
    MOST_CODE_LETTERS,
    MOST_CODES,
    Identity,
    Rejection,
    Status,
    bounded_codes,
)
from ingest.languages.rules import Findings, RejectedError
from ingest.sizes.stated_bodies import Figure

MAX_REASON = 300
"""Characters kept of a rejection's reason."""
MAX_TEXT = 100
"""Characters kept of a name: it is in every batch and advisory of its robot."""


def read(raw: bytes, *, names_as_uuid: str | None = None) -> Identity | Status | Rejection:
    """What one message says. `names_as_uuid` is the vendor whose robots may send a name instead of a UUID."""
    findings = Findings()
    sent_uuid: object = None
    try:
        report = decoded_report(raw, findings)
        sent_uuid = report.uuid
        uuid = vocabulary.robot_uuid(report.uuid, names_as_uuid, findings)
        if fast_decoder.is_status(report):
            return _status(report, uuid, findings)
        return _identity(cast(IdentityReport, report), uuid, findings)
    except RejectedError as rejected:
        return rejection(rejected, sent_uuid, names_as_uuid, findings)


def rejection(rejected: RejectedError, sent_uuid: object, names_as_uuid: str | None, findings: Findings) -> Rejection:
    """A rejected message, with its robot if the UUID that was sent can be read."""
    uuid = _readable_uuid(rejected.sent_uuid or sent_uuid, names_as_uuid)
    return Rejection(rejected.rule, rejected.reason[:MAX_REASON], uuid, tuple(findings))


def _readable_uuid(sent_uuid: object, names_as_uuid: str | None) -> str | None:
    try:
        return vocabulary.robot_uuid(sent_uuid, names_as_uuid, Findings()) if isinstance(sent_uuid, str) else None
    except RejectedError:
        return None


def _identity(report: IdentityReport, uuid: str, findings: Findings) -> Identity:
    stamp = message_stamp(report.timestamp, findings)
    _note_unknown_keys(report, findings)
    size = report.baseRobotEnvelope
    if size.x <= 0 or size.y <= 0 or size.z < 0:
        raise RejectedError("envelope-not-positive", f"baseRobotEnvelope is {size.x:g} x {size.y:g} m; send its size")
    texts = (report.manufacturerName, report.robotModel, report.robotSerialNumber)
    if not all(text.strip() for text in texts):
        findings["text-empty"] = None
    if max(map(len, texts)) > MAX_TEXT:
        findings["text-too-long"] = None
    amounts.run_time(report.maxRunTime, findings)
    max_speed_mps = amounts.speed_limit(report.maxSpeed, findings)
    return Identity(
        uuid=uuid,
        stamp_s=stamp.t_s,
        manufacturer=report.manufacturerName[:MAX_TEXT],
        model=report.robotModel[:MAX_TEXT],
        serial=report.robotSerialNumber[:MAX_TEXT],
        envelope_m=(size.x, size.y, size.z),
        figures=(Figure(cargo.x, cargo.y, "cargoMaxVolume"),) if (cargo := report.cargoMaxVolume) else (),
        max_speed_mps=max_speed_mps,
        findings=tuple(findings),
    )


def _status(report: StatusReport, uuid: str, findings: Findings) -> Status:
    stamp = message_stamp(report.timestamp, findings)
    here = report.location
    if path_points.absurd(here.x, here.y, here.z):
        reason = f"location {here.x:g}, {here.y:g}, {here.z:g} is off any floor; send metres on the datum"
        raise RejectedError("position-absurd", reason)
    _note_unknown_keys(report, findings)
    state, known_state = vocabulary.state(report.operationalState, findings)
    linear_mps, turn_rad_per_s = amounts.motion(report.velocity, findings)
    return Status(  # by position: keyword arguments are slow, and every status comes here
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
        amounts.read(report, findings),
        _error_codes(report.errorCodes, findings) if report.errorCodes else (),
        path_points.destinations(report.destinations, stamp.t_s, findings),
        path_points.path(report.path, stamp.t_s, findings),
        tuple(findings),
    )


def message_stamp(text: str, findings: Findings) -> timestamps.Stamp:
    """The message's own time. Raises `RejectedError` if it can't be read or lies outside 1970 to 2100."""
    stamp = timestamps.parse(text)
    if stamp is None:
        raise RejectedError("stamp-unreadable", f"timestamp {text[:60]!r} is no RFC 3339 date-time in UTC")
    if not timestamps.plausible(stamp.t_s):
        raise RejectedError("stamp-absurd", f"timestamp {text[:60]!r} lies outside 1970 to 2100")
    if stamp.findings:
        findings.update(dict.fromkeys(stamp.findings))
    return stamp


def _note_unknown_keys(report: Report, findings: Findings) -> None:
    """Note keys that the standard does not have, in the report or in any part of it. A decoded report has none."""
    extra = report.__pydantic_extra__
    if extra is None:
        return
    if not repair.finite(extra):
        key = next(key for key, value in extra.items() if not repair.finite(value))
        raise RejectedError("number-not-finite", f"{key[:60]!r} holds NaN or an infinite number; leave it out")
    if extra.keys() - {amounts.LOAD_USED_KEY}:
        findings["key-unknown"] = None
    for name in _parts(type(report)):
        value: Any = getattr(report, name)
        for part in value if isinstance(value, list) else (value,):
            if part is not None:
                _note_unknown_keys(part, findings)


@cache
def _parts(model: type[Report]) -> list[str]:
    """The keys of a report that hold objects of the standard."""
    return [name for name, field in model.model_fields.items() if issubclass(value_type(field.annotation)[0], Report)]


def _error_codes(codes: Sequence[str], findings: Findings) -> tuple[str, ...]:
    if len(codes) > MOST_CODES or max(map(len, codes)) > MOST_CODE_LETTERS:
        findings["codes-too-many"] = None
        codes = bounded_codes(codes)
    if len(set(codes)) < len(codes):
        findings["duplicate-items"] = None
    if not all(code.strip() for code in codes):
        findings["text-empty"] = None
    return tuple(code for code in codes if code.strip())
