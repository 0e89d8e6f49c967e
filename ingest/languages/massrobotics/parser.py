"""One message in; an identity, a status or a rejection out. Never raises, whatever a sender sends."""

from collections.abc import Sequence
from itertools import islice
from typing import cast

from ingest.languages import timestamps
from ingest.languages.massrobotics import amounts, fast_decoder, path_points, vocabulary
from ingest.languages.massrobotics.fast_decoder import struct_of
from ingest.languages.massrobotics.json_objects import Report
from ingest.languages.massrobotics.report_models import IdentityReport, StatusReport
from ingest.languages.massrobotics.report_reader import decoded_report, parts_of
from ingest.languages.model import (
    MAX_TEXT,
    MOST_CODE_LETTERS,
    MOST_CODES,
    Identity,
    Rejection,
    Status,
    bounded_codes,
    rejection_of,
)
from ingest.languages.rules import MOST_ODDITIES, Findings, RejectedError
from ingest.languages.tolerance.spelling import nearest
from ingest.languages.tolerance.tolerant_json import stamp_of, time_of
from ingest.languages.tolerance.value_kinds import object_kind
from ingest.languages.tolerance.value_reader import LEFT_OUT
from ingest.sizes.stated_bodies import Figure

DATUM_PATH = "location.planarDatum"


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
    return rejection_of(rejected, _readable_uuid(rejected.sent_uuid or sent_uuid, names_as_uuid), findings)


def _readable_uuid(sent_uuid: object, names_as_uuid: str | None) -> str | None:
    try:
        return vocabulary.robot_uuid(sent_uuid, names_as_uuid, Findings()) if isinstance(sent_uuid, str) else None
    except RejectedError:
        return None


def _identity(report: IdentityReport, uuid: str, findings: Findings) -> Identity:
    stamp = stamp_of(report.timestamp, findings)
    _note_unknown_keys(report, findings)
    size = report.baseRobotEnvelope
    if size.x <= 0 or size.y <= 0 or size.z < 0:
        sides = f"{size.x:g} x {size.y:g} x {size.z:g}"
        reading = "the default envelope" if min(size.x, size.y) <= 0 else "without its height"
        findings.note("envelope-not-positive", "baseRobotEnvelope", sides, reading)
    for key in ("manufacturerName", "robotModel", "robotSerialNumber"):
        text = getattr(report, key)
        if not text.strip():
            findings.note("text-empty", key, text, "as sent")
        if len(text) > MAX_TEXT:
            findings.note("text-too-long", key, text, f"its first {MAX_TEXT} letters")
    amounts.run_time(report.maxRunTime, "maxRunTime", findings)
    max_speed_mps = amounts.speed_limit(report.maxSpeed, findings)
    return Identity(
        uuid=uuid,
        stamp_s=time_of(stamp),
        manufacturer=report.manufacturerName[:MAX_TEXT],
        model=report.robotModel[:MAX_TEXT],
        serial=report.robotSerialNumber[:MAX_TEXT],
        envelope_m=(max(size.x, 0.0), max(size.y, 0.0), max(size.z, 0.0)),
        figures=(Figure(cargo.x, cargo.y, "cargoMaxVolume"),) if (cargo := report.cargoMaxVolume) else (),
        max_speed_mps=max_speed_mps,
        findings=tuple(findings),
        oddities=tuple(findings.oddities),
    )


def _status(report: StatusReport, uuid: str, findings: Findings) -> Status:
    stamp = stamp_of(report.timestamp, findings)
    here = report.location
    if path_points.absurd(here.x, here.y, 0.0):
        reason = f"location {here.x:g}, {here.y:g} is off any floor; send metres on the datum"
        raise RejectedError("position-absurd", reason)
    height_m = 0.0 if path_points.absurd(0.0, 0.0, here.z) else here.z
    if height_m != here.z:
        findings.note("value-unreadable", "location.z", here.z, LEFT_OUT)
    _note_unknown_keys(report, findings)
    state, known_state = vocabulary.state(report.operationalState, findings)
    stamp_s = stamp.t_s if stamp.is_known else _assumed_s(report)
    linear_mps, turn_rad_per_s = amounts.motion(report.velocity, findings)
    if not known_state:
        state = vocabulary.by_motion(state, linear_mps)
    yaw_rad = path_points.yaw_rad(here.angle, findings)
    path_points.name_angle(here.angle, findings)
    return Status(  # by position: keyword arguments are slow, and every status comes here
        uuid,
        stamp_s,
        stamp.resolution_s,
        state,
        known_state,
        here.x,
        here.y,
        height_m,
        yaw_rad,
        vocabulary.datum(here.planarDatum, here.planarDatumUUID, findings, empty="datum-missing", path=DATUM_PATH),
        linear_mps,
        turn_rad_per_s,
        amounts.read(report, findings),
        _error_codes(report.errorCodes, findings) if report.errorCodes else (),
        path_points.destinations(report.destinations, stamp_s, findings),
        path_points.path(report.path, stamp_s, findings),
        tuple(findings),
        oddities=tuple(findings.oddities),
    )


def _assumed_s(report: StatusReport) -> float:
    """The time of a status without a stamp that can be read."""
    paths = [path_points.path(points, 0.0, Findings()) for points in (report.path, report.destinations)]
    return time_of(timestamps.NO_STAMP, *paths)


def _note_unknown_keys(report: Report, findings: Findings, path: str = "") -> None:
    """Note keys that the standard does not have, in the report or in any part of it. A decoded report has none."""
    extra = report.__pydantic_extra__
    if extra is None:
        return
    names = object_kind(struct_of(type(report))).names
    for key, value in islice(extra.items(), MOST_ODDITIES):
        if key != amounts.LOAD_USED_KEY:
            meant = nearest(key, names)
            findings.note(
                "key-unknown", path + key, value, "not used", "" if meant in report.model_fields_set else meant
            )
    for part, where in parts_of(report):
        _note_unknown_keys(part, findings, f"{path}{where}.")


def _error_codes(codes: Sequence[str], findings: Findings) -> tuple[str, ...]:
    if len(codes) > MOST_CODES or max(map(len, codes)) > MOST_CODE_LETTERS:
        findings.note("codes-too-many", "errorCodes", len(codes), f"the first {MOST_CODES}, cut")
        codes = bounded_codes(codes)
    if len(set(codes)) < len(codes):
        findings.note("duplicate-items", "errorCodes", codes, "as sent")
    if not all(code.strip() for code in codes):
        findings.note("text-empty", "errorCodes", codes, "left out")
    return tuple(code for code in codes if code.strip())
