"""Converts the nodes of a path to a drive: poses and greatest speeds along it.

A drive is sampled by *progress*: metres along the path, plus `TURN_M` for each radian of a turn in place. Speed is
always speed of progress, so one number tells how far a robot has come, including turns.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import atan2, ceil, cos, hypot, sin, sqrt, tan

import numpy as np

from deconflict.simulation.floor_layout import Layout, Place
from deconflict.simulation.participants import Chassis
from ingest.batch import Floats
from ingest.frames.angles import turn_between

SAMPLE_M = 0.1
TURN_M = 0.5
CORNER_M = 0.8
"""Radius of a corner if there is room for it."""
TIGHT_M = 0.3
"""At a corner that would need a smaller radius, the robot turns in place."""
SIDEWAYS_MPS2 = 0.6
CREEP_MPS = 0.06
"""Least speed of a robot on its path, so that it passes the points where it must almost stop."""
WIDE_RAD = 1.2
"""Robots cut corners of smaller angles by the same length as right angles, so that their radius is larger."""
NEARLY_STRAIGHT_RAD = 0.02

SpeedShare = Callable[[Floats, Floats], Floats]
"""The greatest speed at each point, as a share of the robot's own; the points are x and y, both (m,)."""


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A path as samples (m,) at equal steps of progress; m is at least 2."""

    step_m: float
    x_m: Floats
    y_m: Floats
    yaw_rad: Floats
    """Not wrapped."""
    speed_mps: Floats
    """Greatest speed of progress without obstacles, starting and ending at rest."""

    @property
    def length_m(self) -> float:
        return self.step_m * (len(self.x_m) - 1)


@dataclass(frozen=True, slots=True)
class _Piece:
    """A piece of constant curvature: a straight line (`bend` 0), an arc, or a turn in place (`forward` 0)."""

    length_m: float
    start: tuple[float, float, float]
    """x, y, yaw."""
    bend: float
    """Radians per metre of progress."""
    forward: float
    limit_mps: float


def lane(layout: Layout, nodes: Sequence[int], offset_m: float) -> list[Place]:
    """Corners of the path along `nodes`, `offset_m` right of the middle of aisles and in the middle of bays."""
    lines = []
    for a, b in pairwise(nodes):
        (x, y), (to_x, to_y) = layout.places[a], layout.places[b]
        length_m = hypot(to_x - x, to_y - y)
        ux, uy = (to_x - x) / length_m, (to_y - y) / length_m
        aside_m = 0.0 if a in layout.bay_nodes or b in layout.bay_nodes else offset_m
        lines.append((x + uy * aside_m, y - ux * aside_m, ux, uy))
    corners = [layout.places[nodes[0]]]
    for (ax, ay, aux, auy), (bx, by, bux, buy) in pairwise(lines):
        turn = aux * buy - auy * bux
        if abs(turn) > 1e-9:
            along = ((bx - ax) * buy - (by - ay) * bux) / turn
            corners.append((ax + along * aux, ay + along * auy))
    return [*corners, layout.places[nodes[-1]]]


def drive(corners: Sequence[Place], yaw_rad: float, make: Chassis, speed_share: SpeedShare | None = None) -> Drive:
    """The drive of a robot that stands at the first corner, heading `yaw_rad`, to the last."""
    pieces = _pieces(corners, yaw_rad, make)
    ends_m = np.cumsum([piece.length_m for piece in pieces])
    samples = max(2, ceil(ends_m[-1] / SAMPLE_M) + 1)
    progress_m = np.linspace(0.0, ends_m[-1], samples)
    which = np.minimum(np.searchsorted(ends_m, progress_m, side="left"), len(pieces) - 1)
    into_m = progress_m - np.concatenate([[0.0], ends_m])[which]
    x, y, yaw = np.array([piece.start for piece in pieces])[which].T
    bend, forward, limit_mps = np.array([(p.bend, p.forward, p.limit_mps) for p in pieces])[which].T
    turned = yaw + bend * into_m
    safe_bend = np.where(bend == 0.0, 1.0, bend)
    arc_x, arc_y = (np.sin(turned) - np.sin(yaw)) / safe_bend, (np.cos(yaw) - np.cos(turned)) / safe_bend
    x = x + forward * np.where(bend == 0.0, into_m * np.cos(yaw), arc_x)
    y = y + forward * np.where(bend == 0.0, into_m * np.sin(yaw), arc_y)
    if speed_share:
        limit_mps = np.minimum(limit_mps, speed_share(x, y) * make.max_speed_mps)
    limit_mps[np.flatnonzero(np.diff(forward))] = 0.0
    return Drive(float(progress_m[1]), x, y, turned, _reachable(progress_m, limit_mps, make))


def _reachable(progress_m: Floats, limit_mps: Floats, make: Chassis) -> Floats:
    """The greatest speeds within the limits, at rest at both ends: v2^2 = v1^2 + 2 a s, forwards and backwards."""
    squares = np.minimum(limit_mps, make.max_speed_mps) ** 2
    squares[[0, -1]] = 0.0
    gain, brake = 2 * make.gain_mps2 * progress_m, 2 * (make.brake_mps2 / 2) * progress_m
    squares = np.minimum.accumulate(squares - gain) + gain
    squares = np.minimum.accumulate((squares + brake)[::-1])[::-1] - brake
    return np.maximum(np.sqrt(np.maximum(squares, 0.0)), CREEP_MPS)


def _pieces(corners: Sequence[Place], yaw_rad: float, make: Chassis) -> list[_Piece]:
    pieces: list[_Piece] = []
    heading, at = yaw_rad, corners[0]
    for index, (a, b) in enumerate(pairwise(corners)):
        towards = atan2(b[1] - a[1], b[0] - a[0])
        turn = turn_between(heading, towards)
        if abs(turn) > NEARLY_STRAIGHT_RAD:
            bend = (1 if turn > 0 else -1) / TURN_M
            pieces.append(_Piece(abs(turn) * TURN_M, (*at, heading), bend, 0.0, make.turn_radps * TURN_M))
            heading += turn
        radius_m, cut_m, bends = _corner(corners, index)
        end = (b[0] - cut_m * cos(heading), b[1] - cut_m * sin(heading))
        straight_m = hypot(end[0] - at[0], end[1] - at[1])
        pieces.append(_Piece(straight_m, (*at, heading), 0.0, 1.0, make.max_speed_mps))
        at = end
        if cut_m:
            limit_mps = sqrt(SIDEWAYS_MPS2 * radius_m)
            bend = (1 if bends > 0 else -1) / radius_m
            pieces.append(_Piece(abs(bends) * radius_m, (*at, heading), bend, 1.0, limit_mps))
            heading += bends
            at = (b[0] + cut_m * cos(heading), b[1] + cut_m * sin(heading))
    return [piece for piece in pieces if piece.length_m > 1e-9]


def _corner(corners: Sequence[Place], index: int) -> tuple[float, float, float]:
    """Radius, length cut off each leg, and angle of the corner after leg `index`. The cut is 0 for a turn in place."""
    if index + 2 >= len(corners):
        return 0.0, 0.0, 0.0
    a, b, c = corners[index : index + 3]
    before, after = (b[0] - a[0], b[1] - a[1]), (c[0] - b[0], c[1] - b[1])
    bends = turn_between(atan2(before[1], before[0]), atan2(after[1], after[0]))
    half = tan(abs(bends) / 2)
    widest_m = CORNER_M if abs(bends) > WIDE_RAD else CORNER_M / max(half, 1e-9)
    radius_m = min(widest_m, min(hypot(*before), hypot(*after)) / 2 / max(half, 1e-9))
    if radius_m < TIGHT_M or abs(bends) < NEARLY_STRAIGHT_RAD:
        return 0.0, 0.0, bends
    return radius_m, radius_m * half, bends


def standing(place: Place, yaw_rad: float) -> Drive:
    """The drive of a robot that stays where it is."""
    x, y, yaw = (np.full(2, value) for value in (*place, yaw_rad))
    return Drive(SAMPLE_M, x, y, yaw, np.full(2, CREEP_MPS))
