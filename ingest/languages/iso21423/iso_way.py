"""The way that a robot told without times, as it drives along it at its own pace."""

from collections.abc import Iterator, Sequence
from itertools import accumulate, islice, pairwise
from math import atan2, hypot, inf, isnan, nan, pi, remainder

from ingest.batch import Basis
from ingest.frames.angles import turn_between
from ingest.frames.assumed_motion import (
    ASSUMED_TURN_RADPS,
    CORNER_RAD,
    DRIVES_MPS,
    LEAST_STEP_S,
    SPOT_M,
    TURNS_RADPS,
    turn_in_parts,
)
from ingest.languages.geometry.trajectories import Point, curve_ahead, curve_of
from ingest.languages.iso21423.iso_memory import IsoMemory, IsoPose, IsoWay
from ingest.languages.iso21423.iso_messages import OdometryPose, Speeds, WayCurve
from ingest.languages.model import NO_PATH, Path, Row, datum_name
from ingest.languages.rules import Findings

MOVED_M = 0.05
"""A robot that sends no speed drives if it has moved so far since its last pose."""
SHOWS_S = 0.9
"""A part of a path that lasts so long shows a speed."""
MOST_PIECES = 150
"""A path goes on along a way for so many pieces."""
Piece = tuple[float, float, float, float]
"""x, y and yaw at its end, and how long a turn on the spot takes in seconds; 0 if it is driven."""


def way_of(sent: WayCurve | None, findings: Findings) -> IsoWay | None:
    """The way of a global path. None if that is empty, or can't be read."""
    curve = curve_of(sent, findings, "globalPath") if sent and sent.control_points else None
    return IsoWay(curve, datum_name(sent.control_points[0].location_point.ccs_id)) if sent and curve else None


def is_moving(last: IsoPose | None, t_s: float, pose: OdometryPose, velocity: Speeds | None) -> bool:
    """Whether a robot drives or turns at a pose: by its speeds, or else by the odometry before."""
    if velocity and velocity.linear is not None:
        return abs(velocity.linear) > DRIVES_MPS or abs(velocity.angular or 0.0) > TURNS_RADPS
    if last is None:
        return False
    at, was = pose.location_point, last.pose.location_point
    return hypot(at.x - was.x, at.y - was.y) > max(MOVED_M, DRIVES_MPS * (t_s - last.stamp.t_s))


def along_way(memory: IsoMemory, pose: IsoPose, path: Path) -> tuple[Path, Basis]:
    """A path, and how it goes on along the robot's way, with its basis. Without a path that of a robot that moves."""
    at = pose.pose.location_point
    if memory.way is None or memory.way.datum not in ("", datum_name(at.ccs_id)):
        return path, Basis.PATH
    yaw_rad = pose.pose.orientation.yaw if pose.pose.orientation else None
    here = pose.stamp.t_s, at.x, at.y, nan if yaw_rad is None else yaw_rad
    linear_mps = pose.velocity.linear or 0.0 if pose.velocity else 0.0
    if path is not NO_PATH:
        return _beyond(path, memory.way, here, abs(linear_mps)), Basis.PATH
    ahead = curve_ahead(memory.way.curve, (at.x, at.y)) if pose.moves else ()
    backwards_rad = pi if linear_mps < -DRIVES_MPS else 0.0
    pieces = list(islice(_pieces(here, ahead, backwards_rad=backwards_rad), MOST_PIECES))
    return (_paced(pieces, here[0]), Basis.ORDER) if pieces else (path, Basis.PATH)


def _beyond(path: Path, way: IsoWay, here: Row, now_mps: float) -> Path:
    """A path with how it goes on along a way. One that ends in a stop does so where the way has a corner."""
    ahead_s = [row for row in path.poses if row[0] > here[0]]
    rows = [here, *ahead_s]
    if not (path.in_order and ahead_s):
        return path
    speeds, (_, x, y, _) = _speeds_mps(rows), rows[-1]
    is_stop = speeds[-1] <= DRIVES_MPS
    mps = max(*speeds, now_mps) if is_stop else speeds[-1]
    heading_rad = next((_direction_rad(a, b) for a, b in pairwise(reversed(rows)) if _length_m(a, b) > MOVED_M), nan)
    end = (*rows[-1][:3], heading_rad if isnan(rows[-1][3]) else rows[-1][3])
    pieces = list(islice(_pieces(end, curve_ahead(way.curve, (x, y)), backwards_rad=0.0), MOST_PIECES))
    has_corner = pieces and pieces[0][3] > 0.0
    return _joined(path, pieces, mps) if pieces and mps > DRIVES_MPS and (has_corner or not is_stop) else path


def _direction_rad(after: Row, before: Row) -> float:
    return atan2(after[2] - before[2], after[1] - before[1])


def _length_m(before: Row, after: Row) -> float:
    return hypot(after[1] - before[1], after[2] - before[2])


def _speeds_mps(rows: Sequence[Row]) -> list[float]:
    """The speed at each of the rows (r, 4), in the order of their times, but the first."""
    gone_m = list(accumulate((_length_m(before, after) for before, after in pairwise(rows)), initial=0.0))
    speeds, begin = [], 0
    for end in range(1, len(rows)):
        while begin + 1 < end and rows[end][0] - rows[begin + 1][0] >= SHOWS_S:
            begin += 1
        speeds.append((gone_m[end] - gone_m[begin]) / max(rows[end][0] - rows[begin][0], LEAST_STEP_S))
    return speeds


def _pieces(start: Row, ahead: Sequence[Point], *, backwards_rad: float) -> Iterator[Piece]:
    """The places of a way from a place on, with turns on the spot where it has a corner."""
    _, x, y, heading_rad = start
    for to_x, to_y in ahead:
        if hypot(to_x - x, to_y - y) < SPOT_M:
            continue
        direction_rad = remainder(atan2(to_y - y, to_x - x) + backwards_rad, 2 * pi)
        turn_rad = turn_between(heading_rad, direction_rad)
        if abs(turn_rad) > CORNER_RAD:
            parts = turn_in_parts(heading_rad, direction_rad)
            for _, at_rad in parts:
                yield x, y, at_rad, abs(turn_rad) / ASSUMED_TURN_RADPS / len(parts)
        yield to_x, to_y, direction_rad, 0.0
        x, y, heading_rad = to_x, to_y, direction_rad


def _paced(pieces: Sequence[Piece], t_s: float) -> Path:
    """The pieces as a path without times of its own."""
    rows = tuple((t_s + row, x, y, yaw_rad) for row, (x, y, yaw_rad, _) in enumerate(pieces, 1))
    ends_s = rows[0][0], rows[-1][0]
    return Path(rows, ("",) * len(rows), True, ends_s, (inf,) * len(rows), ends_in_stop=True)


def _joined(own: Path, pieces: Sequence[Piece], mps: float) -> Path:
    """A path with times of its own, and how it goes on at a speed."""
    t_s, x, y, _ = own.poses[-1]
    rows = []
    for to_x, to_y, yaw_rad, turn_s in pieces:
        t_s += max(turn_s or hypot(to_x - x, to_y - y) / mps, LEAST_STEP_S)
        rows.append((t_s, to_x, to_y, yaw_rad))
        x, y = to_x, to_y
    datums = own.datums + (own.datums[-1],) * len(rows)
    return Path((*own.poses, *rows), datums, True, (own.ends_s[0], t_s), (), ends_in_stop=True)
