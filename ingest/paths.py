"""Timed poses of a message: its path, its destinations, and the heading of a quaternion."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import atan2, nan

import numpy as np

from ingest import stamps, words
from ingest.conformance import Findings
from ingest.reports import PredictedLocation, Quaternion
from ingest.seam import Floats
from ingest.settings import NIL_DATUM

MAX_POSITION = 1e7
"""Metres, or degrees: beyond it a location is absurd."""
PATH_S, DESTINATIONS_S = 10.0, 900.0
"""How far ahead the standard lets a path and destinations reach."""
MOST_POINTS = 10
MOST_POINTS_USED = 200
SLACK_S = 1.0
"""How far a time may lie beyond a limit before it is a finding: stamps are rounded."""
UNSET_CLOCK_S = 366 * 86400.0
"""Times before this, in 1970, come of a clock that was never set or counts from the start of something."""


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Timed poses as sent: `poses` (p, 5) as t_s, x, y, z, yaw_rad, nan where the heading is unknown."""

    poses: Floats
    datums: tuple[str, ...]
    """(p,) lower case; "" is the robot's own."""


NO_PATH = Path(np.empty((0, 5)), ())


def absurd(x: float, y: float, z: float) -> bool:
    """Whether a position lies off any site."""
    return not (abs(x) <= MAX_POSITION and abs(y) <= MAX_POSITION and abs(z) <= MAX_POSITION)


def yaw_rad(angle: Quaternion | None, findings: Findings) -> float:
    """Rotation about the vertical, -pi to pi; nan where there is none.

    atan2(2 (wz + xy), w^2 + x^2 - y^2 - z^2): the direction of the turned x axis, whatever the quaternion's length.
    """
    if angle is None:
        findings["angle-missing"] = None
        return nan
    x, y, z, w = angle.x, angle.y, angle.z, angle.w
    square = x * x + y * y + z * z + w * w
    if not 0.99 < square < 1.01:
        largest = max(abs(x), abs(y), abs(z), abs(w))
        if largest < 1e-6:
            findings["angle-zero"] = None
            return nan
        findings["angle-not-unit"] = None
        x, y, z, w = x / largest, y / largest, z / largest, w / largest
    return atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def path(points: Sequence[PredictedLocation] | None, stamp_s: float, findings: Findings) -> Path:
    """The path in the order sent, whatever its times; `ingest/forecast.py` gives new ones where they can't be used."""
    if not points:
        return NO_PATH
    read = _read(points, findings)
    if not read.datums:
        return read
    if len(points) > MOST_POINTS:
        findings["path-too-many"] = None
    times = read.poses[:, 0].tolist()
    if max(times) > stamp_s + PATH_S + SLACK_S:
        findings["path-too-far"] = None
    if min(times) < stamp_s - SLACK_S:
        findings[_past(times, stamp_s)] = None
    if len(set(times)) < len(times):
        findings["path-times-equal"] = None
    if any(later < earlier for earlier, later in pairwise(times)):
        findings["path-unordered"] = None
    return read


def _past(times: list[float], stamp_s: float) -> str:
    if max(times) < UNSET_CLOCK_S <= stamp_s:
        return "path-times-1970"
    return "path-past" if max(times) <= stamp_s else "path-partly-past"


def destinations(points: Sequence[PredictedLocation] | None, stamp_s: float, findings: Findings) -> Path:
    """The destinations in the order of their times."""
    if not points:
        return NO_PATH
    read = _read(points, findings)
    if not read.datums:
        return read
    if len(points) > MOST_POINTS:
        findings["destinations-too-many"] = None
    times = read.poses[:, 0]
    if times.max() > stamp_s + DESTINATIONS_S + SLACK_S:
        findings["destinations-too-far"] = None
    if times.max() < stamp_s - SLACK_S:
        findings["destinations-past"] = None
    if not (times[:-1] > times[1:]).any():
        return read
    findings["destinations-unsorted"] = None
    order = np.argsort(times, kind="stable")
    return Path(read.poses[order], tuple(read.datums[row] for row in order))


def _read(points: Sequence[PredictedLocation], findings: Findings) -> Path:
    rows: list[tuple[float, float, float, float, float]] = []
    datums: list[str] = []
    for point in points[:MOST_POINTS_USED]:
        t_s, odd = _when(point.timestamp)
        if t_s is None:
            findings["point-unreadable"] = None
        elif not stamps.plausible(t_s) or absurd(point.x, point.y, point.z):
            findings["point-absurd"] = None
        else:
            if odd:
                findings.update(dict.fromkeys(odd))
            rows.append((t_s, point.x, point.y, point.z, yaw_rad(point.angle, findings)))
            datums.append(_datum(point, findings))
    if not rows:
        return NO_PATH
    if len(set(zip(rows, datums, strict=True))) < len(rows):
        findings["duplicate-items"] = None
    return Path(np.array(rows), tuple(datums))


def _when(text: str) -> tuple[float | None, tuple[str, ...]]:
    """Seconds since the epoch, or None, and what is odd about the text."""
    t_s = stamps.seconds(text)
    stamp = stamps.parse(text) if t_s is None else None
    return (stamp.t_s, stamp.findings) if stamp else (t_s, ())


def _datum(point: PredictedLocation, findings: Findings) -> str:
    if point.planarDatumUUID is None and point.planarDatum is None:
        return ""
    datum = words.datum(point.planarDatumUUID, point.planarDatum, findings, empty="datum-empty")
    return "" if datum == NIL_DATUM else datum
