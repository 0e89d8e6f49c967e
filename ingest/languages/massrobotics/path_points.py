"""Timed poses of a message: its path, its destinations, and the heading of a quaternion."""

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, nan
from operator import le, lt

from ingest.languages import timestamps
from ingest.languages.massrobotics import vocabulary
from ingest.languages.massrobotics.json_objects import PredictedLocation, Quaternion
from ingest.languages.model import MAX_POSITION, NO_PATH, Path, Row
from ingest.languages.rules import Findings
from ingest.settings import NIL_DATUM

PATH_S, DESTINATIONS_S = 10.0, 900.0
"""How far ahead the standard lets a path and destinations reach."""
MOST_POINTS = 10
MOST_POINTS_USED = 200
PATH_TIMES, DESTINATION_TIMES = "path[*].timestamp", "destinations[*].timestamp"
ANGLE_IN_Z = "normalised; is z the heading as an angle? A quaternion has z = sin(heading / 2), w = cos(heading / 2)"
SLACK_S = 1.0
"""A time may be this far beyond a limit without a deviation, since stamps are rounded."""
UNSET_CLOCK_S = 366 * 86400.0
"""Times before this, in 1970, come from a clock that was never set, or that counts from some start."""


def absurd(x: float, y: float, z: float) -> bool:
    """Whether a position lies off any site."""
    return not (abs(x) <= MAX_POSITION and abs(y) <= MAX_POSITION and abs(z) <= MAX_POSITION)


def yaw_rad(angle: Quaternion | None, findings: Findings, path: str = "location.angle") -> float:
    """Rotation about the vertical, -pi to pi; nan if the angle, which stands at `path`, is missing or all zeros.

    atan2(2 (wz + xy), w^2 + x^2 - y^2 - z^2): the direction of the turned x axis, for a quaternion of any length.
    """
    if angle is None:
        findings.note("angle-missing", path, None, "heading unknown")
        return nan
    x, y, z, w = angle.x, angle.y, angle.z, angle.w
    square = x * x + y * y + z * z + w * w
    if not 0.99 < square < 1.01:
        largest = max(abs(x), abs(y), abs(z), abs(w))
        if largest < 1e-6:
            findings.note("angle-zero", path, [x, y, z, w], "heading unknown")
            return nan
        findings["angle-not-unit"] = None
        x, y, z, w = x / largest, y / largest, z / largest, w / largest
    return atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def name_angle(angle: Quaternion | None, findings: Findings) -> None:
    """Name the quaternion of a location that was not of unit length, if its z alone varies: an angle was put there."""
    if angle and "angle-not-unit" in findings and not (angle.x or angle.y) and angle.w in (0.0, 1.0):
        sent = {"x": angle.x, "y": angle.y, "z": angle.z, "w": angle.w}
        findings.note("angle-not-unit", "location.angle", sent, ANGLE_IN_Z)


def path(points: Sequence[PredictedLocation] | None, stamp_s: float, findings: Findings) -> Path:
    """The path in the order sent. `ingest/fleet/prediction/path_forecast.py` replaces times that can't be used."""
    read = _read(points, stamp_s, findings)
    return read if points is None else checked_path(read, len(points), stamp_s, findings)


def checked_path(read: Path, sent: int, stamp_s: float, findings: Findings) -> Path:
    """Note what is wrong with the number and the times of a path of `sent` points. Returns the path."""
    if read is NO_PATH:
        return read
    ends_s = read.ends_s
    if not read.in_order:
        times = read.times
        _note_disorder(times, findings)
        ends_s = min(times), max(times)
    check_path(sent, ends_s, stamp_s, findings)
    return read


def check_path(sent: int, ends_s: tuple[float, float], stamp_s: float, findings: Findings) -> None:
    """Note what is wrong with the number of a path's points and with their first and last time."""
    first_s, last_s = ends_s
    if sent > MOST_POINTS:
        findings.note("path-too-many", "path", sent, f"the first {MOST_POINTS_USED}")
    if last_s > stamp_s + PATH_S + SLACK_S:
        findings.note("path-too-far", PATH_TIMES, last_s, "used when the horizon reaches it")
    if first_s < stamp_s - SLACK_S:
        rule = _past(last_s, stamp_s)
        is_partly = rule == "path-partly-past"
        findings.note(
            rule, PATH_TIMES, first_s if is_partly else last_s, "the later ones" if is_partly else "new times"
        )


def _in_order(times: list[float]) -> bool:
    return all(map(lt, times, times[1:]))


def _note_disorder(times: list[float], findings: Findings) -> None:
    if len(set(times)) < len(times):
        findings.note("path-times-equal", PATH_TIMES, timestamps.first_fall(sorted(times)), "left out, or new times")
    if any(later < earlier for earlier, later in pairwise(times)):
        findings.note("path-unordered", PATH_TIMES, timestamps.first_fall(times), "sorted, or new times")


def _past(last_s: float, stamp_s: float) -> str:
    if last_s < UNSET_CLOCK_S <= stamp_s:
        return "path-times-1970"
    return "path-past" if last_s <= stamp_s else "path-partly-past"


def destinations(points: Sequence[PredictedLocation] | None, stamp_s: float, findings: Findings) -> Path:
    """The destinations in the order of their times."""
    read = _read(points, stamp_s, findings)
    return read if points is None else checked_destinations(read, len(points), stamp_s, findings)


def checked_destinations(read: Path, sent: int, stamp_s: float, findings: Findings) -> Path:
    """Note what is wrong with `sent` destinations. Returns them in the order of their times."""
    if read is NO_PATH:
        return read
    check_destinations(sent, read.ends_s[1] if read.in_order else max(read.times), stamp_s, findings)
    if read.in_order:
        return read
    times = read.times
    if all(map(le, times, times[1:])):
        return read
    findings.note("destinations-unsorted", DESTINATION_TIMES, timestamps.first_fall(times), "sorted")
    order = sorted(range(len(times)), key=times.__getitem__)
    poses, datums = tuple(read.poses[row] for row in order), tuple(read.datums[row] for row in order)
    return Path(poses, datums, len(set(times)) == len(times), (times[order[0]], times[order[-1]]))


def check_destinations(sent: int, latest_s: float, stamp_s: float, findings: Findings) -> None:
    """Note what is wrong with the number of destinations and with the latest of their times."""
    if sent > MOST_POINTS:
        findings.note("destinations-too-many", "destinations", sent, f"the first {MOST_POINTS_USED}")
    if latest_s > stamp_s + DESTINATIONS_S + SLACK_S:
        findings.note("destinations-too-far", DESTINATION_TIMES, latest_s, "not used yet")
    if latest_s < stamp_s - SLACK_S:
        findings.note("destinations-past", DESTINATION_TIMES, latest_s, "as sent")


def _read(points: Sequence[PredictedLocation] | None, stamp_s: float, findings: Findings) -> Path:
    if not points:
        return NO_PATH
    points = points[:MOST_POINTS_USED]
    rows = _conforming_rows(points, findings)
    if rows is None:
        rows, points = _readable_rows(points, stamp_s, findings)
    if not rows:
        return NO_PATH
    datums = _datums(points, findings)
    in_order = _in_order([row[0] for row in rows])
    if not in_order:
        heights = [point.z for point in points]
        if len(set(zip(rows, datums, heights, strict=True))) < len(rows):
            findings["duplicate-items"] = None
    return Path(tuple(rows), datums, in_order, (rows[0][0], rows[-1][0]))


def _conforming_rows(points: Sequence[PredictedLocation], findings: Findings) -> list[Row] | None:
    """The points (p, 4). None if one deviates in more than its timestamp, which is rare."""
    read = timestamps.plain_seconds([point.timestamp for point in points])
    if read is None:
        return None
    rows, limit, (times, stamp_findings) = [], MAX_POSITION, read
    for t_s, point in zip(times, points, strict=True):
        angle, at_x, at_y = point.angle, point.x, point.y
        if angle is None or not (-limit <= at_x <= limit and -limit <= at_y <= limit and -limit <= point.z <= limit):
            return None
        x, y, z, w = angle.x, angle.y, angle.z, angle.w
        square_x, square_y, square_z, square_w = x * x, y * y, z * z, w * w
        if not 0.99 < square_x + square_y + square_z + square_w < 1.01:
            return None
        rows.append((t_s, at_x, at_y, atan2(2.0 * (w * z + x * y), square_w + square_x - square_y - square_z)))
    if stamp_findings:
        findings.update(dict.fromkeys(stamp_findings))
    return rows


def _readable_rows(
    points: Sequence[PredictedLocation], stamp_s: float, findings: Findings
) -> tuple[list[Row], Sequence[PredictedLocation]]:
    """The points that can be read, as rows (p, 4) and as sent."""
    rows: list[Row] = []
    read = []
    for number, point in enumerate(points):
        if absurd(point.x, point.y, point.z):
            findings.note("point-absurd", f"[{number}]", [point.x, point.y, point.z], "left out")
            continue
        t_s = timestamps.point_time_s(point.timestamp, f"[{number}].timestamp", findings)
        rows.append((t_s, point.x, point.y, yaw_rad(point.angle, findings, f"[{number}].angle")))
        read.append(point)
    times = timestamps.filled([row[0] for row in rows], stamp_s)
    return [(t_s, *row[1:]) for t_s, row in zip(times, rows, strict=True)], read


def _datums(points: Sequence[PredictedLocation], findings: Findings) -> tuple[str, ...]:
    """(p,) the datum of each point. Most paths have one datum for all points."""
    proper, misplaced = points[0].planarDatumUUID, points[0].planarDatum
    for point in points:
        if point.planarDatumUUID != proper or point.planarDatum != misplaced:
            return tuple(datum(each.planarDatumUUID, each.planarDatum, findings) for each in points)
    return (datum(proper, misplaced, findings),) * len(points)


def datum(proper: str | None, misplaced: str | None, findings: Findings) -> str:
    """The datum of a point, as `vocabulary.datum` reads it. "" means the robot's own datum."""
    if proper is None and misplaced is None:
        return ""
    name = vocabulary.datum(proper, misplaced, findings, empty="datum-empty")
    return "" if name == NIL_DATUM else name
