"""One message: bytes in; an identity, a status or a counted rejection out. Never raises on what a sender sent.

A conforming message is validated once, from bytes. One that does not validate is parsed, mended where its meaning
is plain, and validated again. Duplicate keys: the last one holds.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import atan2, isfinite, isnan, nan
from typing import Any
from uuid import UUID, uuid5

import numpy as np
from pydantic import ValidationError
from pydantic_core import from_json

from ingest import mending, stamps
from ingest.reports import IdentityReport, PredictedLocation, Quaternion, Report, StatusReport
from ingest.seam import Floats
from ingest.settings import NIL_DATUM

NAMED_ROBOTS = UUID("b7f0f4f1-3a3c-5d52-9a63-2b2c8a0f9d10")
"""Namespace of the UUIDs of robots that are known by name."""
MAX_POSITION = 1e7
"""Metres, or degrees: beyond it a location is absurd."""
MAX_ENVELOPE_M = 100.0
MAX_REASON = 300
PATH_S, DESTINATIONS_S = 10.0, 900.0
"""How far ahead the standard lets a path and destinations reach."""
MOST_POINTS = 10
SLACK_S = 1.0
"""Allowed beyond those before it is a finding: stamps are rounded."""

STATES = frozenset(
    (
        "navigating",
        "idle",
        "disabled",
        "offline",
        "charging",
        "waitingHumanEvent",
        "waitingExternalEvent",
        "waitingInternalEvent",
        "manualOverride",
    )
)
_ALIASES = {state.casefold(): state for state in STATES} | {
    "manual": "manualOverride",
    "manualmode": "manualOverride",
    "waiting": "waitingInternalEvent",
    "waitinghuman": "waitingHumanEvent",
    "waitingforhumanevent": "waitingHumanEvent",
    "waitingonexternalevent": "waitingExternalEvent",
    "waitingoninternalevent": "waitingInternalEvent",
    "loadingunloading": "waitingExternalEvent",
    "moving": "navigating",
}


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Timed poses as sent: `poses` (p, 5) as t_s, x, y, z, yaw_rad, nan where the heading is unknown."""

    poses: Floats
    datums: tuple[str, ...]
    """(p,) lower case; "" is the robot's own."""


@dataclass(frozen=True, slots=True, eq=False)
class Identity:
    """Who a robot is, in so far as prediction needs it; `document` has the rest."""

    uuid: str
    stamp_s: float
    manufacturer: str
    model: str
    serial: str
    envelope_m: tuple[float, float, float]
    """Height 0 where unknown."""
    max_speed_mps: float | None
    findings: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Status:
    """Where a robot is and will be, as sent: its own clock, its own frame."""

    uuid: str
    stamp_s: float
    stamp_resolution_s: float
    state: str
    """As the schema spells it, or the sender's own word."""
    known_state: bool
    x: float
    y: float
    z: float
    yaw_rad: float
    """nan where unknown."""
    datum: str
    """Lower case; "" where none was sent."""
    linear_mps: float | None
    turn_rad_per_s: float | None
    load_used_pct: float | None
    battery_pct: float | None
    error_codes: tuple[str, ...]
    destinations: Path
    path: Path
    findings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Rejection:
    """A message that can't be understood: which rule, and what the sender should change."""

    rule: str
    reason: str
    uuid: str | None = None
    findings: tuple[str, ...] = ()


class _RejectedError(Exception):
    def __init__(self, rule: str, reason: str) -> None:
        super().__init__(reason)
        self.rule, self.reason = rule, reason[:MAX_REASON]


def read(raw: bytes, *, names_as_uuid: str | None = None) -> Identity | Status | Rejection:
    """What one message says. `names_as_uuid` is the vendor whose robots may go by name instead of a UUID."""
    findings: dict[str, None] = {}
    uuid: str | None = None
    try:
        report = _report(raw, findings)
        uuid = _uuid(report.uuid, names_as_uuid, findings)
        _note_extras(report, findings)
        if isinstance(report, StatusReport):
            return _status(report, uuid, findings)
        return _identity(report, uuid, findings)
    except _RejectedError as rejected:
        return Rejection(rejected.rule, rejected.reason, uuid, tuple(findings))


def document(raw: bytes) -> dict[str, Any]:
    """Everything an accepted message said, mended, JSON-ready; keys as the standard spells them."""
    return _report(raw, {}).model_dump(mode="json", exclude_none=True)


def _report(raw: bytes, findings: dict[str, None]) -> IdentityReport | StatusReport:
    model: type[IdentityReport | StatusReport] = StatusReport if b'"operationalState"' in raw else IdentityReport
    try:
        return model.model_validate_json(raw)
    except ValidationError:
        return _mended(raw, findings)


def _mended(raw: bytes, findings: dict[str, None]) -> IdentityReport | StatusReport:
    told = _parsed(raw)
    if not isinstance(told, dict):
        raise _RejectedError("not-object", "send one JSON object a message")
    status = "operationalState" in told or "location" in told
    if not status and not {"baseRobotEnvelope", "manufacturerName", "robotModel"} & told.keys():
        raise _RejectedError("report-unknown", f"keys {_shown(sorted(map(str, told)))} are of neither report")
    noted, mended = mending.mend(told, status=status)
    findings.update(dict.fromkeys(noted))
    try:
        return (StatusReport if status else IdentityReport).model_validate(mended)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        where = ".".join(map(str, first["loc"]))[:100]
        rule = {"missing": "key-missing", "finite_number": "number-not-finite"}.get(first["type"], "type-wrong")
        raise _RejectedError(rule, f"{where}: {first['msg']}") from None


def _parsed(raw: bytes) -> Any:
    try:
        return from_json(raw, allow_inf_nan=True)
    except ValueError as error:
        try:
            raw.decode()
        except UnicodeDecodeError as broken:
            raise _RejectedError("not-utf8", f"byte {broken.start} is not UTF-8; send JSON text in UTF-8") from None
        raise _RejectedError("not-json", f"{error}") from None


def _shown(keys: Sequence[str]) -> str:
    return json.dumps([key[:30] for key in keys[:8]])


def _uuid(text: str, names_as_uuid: str | None, findings: dict[str, None]) -> str:
    try:
        parsed = UUID(text)
    except ValueError:
        if names_as_uuid and text.strip():
            findings["uuid-is-name"] = None
            return str(uuid5(NAMED_ROBOTS, f"{names_as_uuid}/{text}"))
        reason = f"{text[:60]!r} is no UUID; send one, or set names_as_uuid for this vendor"
        raise _RejectedError("uuid-unreadable", reason) from None
    plain = str(parsed)
    if text != plain:
        findings["uuid-upper-case" if text.lower() == plain else "uuid-no-dashes"] = None
    if parsed.variant != "specified in RFC 4122" or not 1 <= (parsed.version or 0) <= 8:
        findings["uuid-not-rfc4122"] = None
    return plain


def _note_extras(report: Report, findings: dict[str, None]) -> None:
    if report.model_extra:
        findings["key-unknown"] = None


def _stamp(text: str, findings: dict[str, None]) -> stamps.Stamp:
    stamp = stamps.parse(text)
    if stamp is None:
        raise _RejectedError("stamp-unreadable", f"timestamp {text[:60]!r} is no RFC 3339 date-time in UTC")
    if not stamps.EARLIEST_S <= stamp.t_s <= stamps.LATEST_S:
        raise _RejectedError("stamp-absurd", f"timestamp {text[:60]!r} lies outside 1970 to 2100")
    findings.update(dict.fromkeys(stamp.findings))
    return stamp


def _identity(report: IdentityReport, uuid: str, findings: dict[str, None]) -> Identity:
    stamp = _stamp(report.timestamp, findings)
    size = report.baseRobotEnvelope
    _note_extras(size, findings)
    if size.x <= 0 or size.y <= 0 or size.z < 0:
        raise _RejectedError("envelope-not-positive", f"baseRobotEnvelope {size.x} x {size.y} m; send its size")
    if max(size.x, size.y, size.z) > MAX_ENVELOPE_M:
        raise _RejectedError("envelope-absurd", f"baseRobotEnvelope {size.x} x {size.y} m; sizes are in metres")
    if not all((report.manufacturerName.strip(), report.robotModel.strip(), report.robotSerialNumber.strip())):
        findings["text-empty"] = None
    max_speed_mps = report.maxSpeed
    if max_speed_mps is not None and max_speed_mps <= 0:
        findings["speed-limit-negative"] = None
        max_speed_mps = None
    return Identity(
        uuid,
        stamp.t_s,
        report.manufacturerName,
        report.robotModel,
        report.robotSerialNumber,
        (size.x, size.y, size.z),
        max_speed_mps,
        tuple(findings),
    )


def _status(report: StatusReport, uuid: str, findings: dict[str, None]) -> Status:
    stamp = _stamp(report.timestamp, findings)
    here = report.location
    if not (abs(here.x) <= MAX_POSITION and abs(here.y) <= MAX_POSITION and abs(here.z) <= MAX_POSITION):
        raise _RejectedError("position-absurd", f"location {here.x}, {here.y}; send metres on the datum")
    _note_extras(here, findings)
    if report.velocity:
        _note_extras(report.velocity, findings)
    state, known = _state(report.operationalState, findings)
    datum = _datum(here.planarDatum, here.planarDatumUUID, findings)
    if datum in ("", NIL_DATUM):
        findings["datum-missing"] = None
    angular = report.velocity.angular if report.velocity else None
    turn = _yaw(angular, findings) if angular else None
    available = _share(report.loadPercentageStillAvailable, "load-out-of-range", findings)
    if report.remainingRunTime is not None and report.remainingRunTime < 0:
        findings["run-time-negative"] = None
    codes = tuple(report.errorCodes or ())
    if len(set(codes)) < len(codes):
        findings["duplicate-items"] = None
    return Status(
        uuid=uuid,
        stamp_s=stamp.t_s,
        stamp_resolution_s=stamp.resolution_s,
        state=state,
        known_state=known,
        x=here.x,
        y=here.y,
        z=here.z,
        yaw_rad=_yaw(here.angle, findings),
        datum=datum,
        linear_mps=report.velocity.linear if report.velocity else None,
        turn_rad_per_s=None if turn is None or isnan(turn) else turn,
        load_used_pct=None if available is None else 100.0 - available,
        battery_pct=_share(report.batteryPercentage, "battery-out-of-range", findings),
        error_codes=codes,
        destinations=_destinations(report.destinations or (), stamp.t_s, findings),
        path=_path(report.path or (), stamp.t_s, findings),
        findings=tuple(findings),
    )


def _state(text: str, findings: dict[str, None]) -> tuple[str, bool]:
    if text in STATES:
        if text == "offline":
            findings["state-offline"] = None
        return text, True
    alias = _ALIASES.get("".join(letter for letter in text.casefold() if letter.isalnum()))
    findings["state-alias" if alias else "state-unknown"] = None
    return (alias, True) if alias else (text[:60], False)


def _share(value: float | None, rule: str, findings: dict[str, None]) -> float | None:
    if value is None or 0.0 <= value <= 100.0:
        return value
    findings[rule] = None
    return min(max(value, 0.0), 100.0)


def _datum(right: str | None, other: str | None, findings: dict[str, None]) -> str:
    """A datum in lower case, "" for none, from the key where it belongs or from the other."""
    if other is not None:
        findings["datum-key"] = None
    text = (right or other or "").strip()
    lower = text.lower()
    if lower != text:
        findings["datum-upper-case"] = None
    if lower:
        try:
            UUID(lower)
        except ValueError:
            findings["datum-not-uuid"] = None
    return lower[:80]


def _yaw(angle: Quaternion, findings: dict[str, None]) -> float:
    """Rotation about the vertical, radians; nan for a quaternion of no length."""
    x, y, z, w = angle.x, angle.y, angle.z, angle.w
    length = x * x + y * y + z * z + w * w
    if not isfinite(length) or length < 1e-12:
        findings["angle-zero"] = None
        return nan
    if abs(length - 1.0) > 0.01:
        findings["angle-not-unit"] = None
    return atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def _points(points: Sequence[PredictedLocation], findings: dict[str, None]) -> Path:
    rows: list[tuple[float, float, float, float, float]] = []
    datums: list[str] = []
    for point in points:
        stamp = stamps.parse(point.timestamp)
        if stamp is None or max(abs(point.x), abs(point.y), abs(point.z)) > MAX_POSITION:
            findings["point-unreadable"] = None
            continue
        if stamp.findings:
            findings.update(dict.fromkeys(stamp.findings))
        _note_extras(point, findings)
        rows.append((stamp.t_s, point.x, point.y, point.z, _yaw(point.angle, findings)))
        has_datum = point.planarDatum is not None or point.planarDatumUUID is not None
        datum = _datum(point.planarDatumUUID, point.planarDatum, findings) if has_datum else ""
        datums.append("" if datum == NIL_DATUM else datum)
    if len(set(rows)) < len(rows):
        findings["duplicate-items"] = None
    return Path(np.array(rows, np.float64).reshape(-1, 5), tuple(datums))


def _path(points: Sequence[PredictedLocation], stamp_s: float, findings: dict[str, None]) -> Path:
    path = _points(points, findings)
    if not len(path.poses):
        return path
    times = path.poses[:, 0].tolist()
    if len(points) > MOST_POINTS:
        findings["path-too-many"] = None
    if max(times) > stamp_s + PATH_S + SLACK_S:
        findings["path-too-far"] = None
    if max(times) <= stamp_s:
        findings["path-past"] = None
    if any(later <= earlier for earlier, later in pairwise(times)):
        findings["path-unordered"] = None
    return path


def _destinations(points: Sequence[PredictedLocation], stamp_s: float, findings: dict[str, None]) -> Path:
    path = _points(points, findings)
    if not len(path.poses):
        return path
    times = path.poses[:, 0]
    if len(points) > MOST_POINTS:
        findings["destinations-too-many"] = None
    if times.max() > stamp_s + DESTINATIONS_S + SLACK_S:
        findings["destinations-too-far"] = None
    order = np.argsort(times, kind="stable")
    if np.any(np.diff(times) < 0):
        findings["destinations-unsorted"] = None
    return Path(path.poses[order], tuple(path.datums[row] for row in order))
