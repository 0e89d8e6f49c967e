"""Trailers as robots of their own: their forecasts follow from that of the robot that pulls them."""

from collections.abc import Container
from itertools import chain
from math import atan2, ceil, cos, hypot, sin

import numpy as np

from ingest.batch import Floats, Forecasts, Ints
from ingest.frames.angles import turn_between
from ingest.frames.towing import STEP_M, axle_at, towed_yaw
from ingest.kernels import FLOATS, INTS, MATRIX, READ_FLOATS, READ_INTS, copy_row, copy_rows, inner, kernel, ready
from ingest.shapes import Trailer, is_sound

BEND_RAD = 0.05
"""A trailer gets a knot after each such turn of itself."""
STRAIGHT_RAD = 1e-3
"""A train is straight if no heading differs by more than this from the direction of travel."""
MOST_STEPS = 1000
"""Between two knots of the robot."""

_turn_between, _towed_yaw, _axle_at = inner(turn_between), inner(towed_yaw), inner(axle_at)


def trailer_forecasts(forecasts: Forecasts, without: Container[int] = ()) -> tuple[Forecasts, Ints]:
    """The forecasts of all trailers, train by train, and the row of the robot that pulls each. Trailers of the rows
    `without` are left out, and trains that can't be swept."""
    pulled = ((row, forecasts.shape(row)) for row in rows_of_trains(forecasts) if row not in without)
    sound = {row: shape for row, shape in pulled if shape and is_sound(shape)}
    rows, shapes = list(sound), list(sound.values())
    if not shapes:
        return Forecasts.empty(), np.empty(0, np.int64)
    counts = [len(shape.trailers) for shape in shapes]
    numbers = np.fromiter(chain.from_iterable(chain.from_iterable(shape.trailers for shape in shapes)), np.float64)
    length_m, width_m, hitches_m, yaws_rad = numbers.reshape(-1, len(Trailer._fields)).T.copy()
    axles_m, begins = np.array([shape.axle_m for shape in shapes]), np.cumsum([0, *counts])
    f, pulling = forecasts, np.array(rows, np.int64)
    t_s, x_m, y_m, yaw_rad = (ready(column) for column in (f.t_s, f.x_m, f.y_m, f.yaw_rad))
    floor, trains = ready(f.floor, np.int64), (pulling, axles_m, begins, hitches_m, yaws_rad)
    start, t_s, poses, floor = _towed_trains(ready(f.start, np.int64), t_s, x_m, y_m, yaw_rad, floor, *trains)
    pulled_by = np.repeat(pulling, counts)
    x_m, y_m, yaw_rad = poses.T.copy()
    heights_m = f.bottom_m[pulled_by], f.top_m[pulled_by]
    return Forecasts(start, t_s, x_m, y_m, yaw_rad, floor, length_m, width_m, *heights_m), pulled_by


def rows_of_trains(forecasts: Forecasts) -> list[int]:
    """The rows of robots that pull trailers."""
    shapes = () if forecasts.shapes is None else forecasts.shapes
    return [row for row, shape in enumerate(shapes) if shape is not None and shape.trailers]


@inner
def _steps(dx: float, dy: float, turn: float, axle_m: float, yaws: Floats) -> int:
    """Into how many steps a way is cut: a single one if the train is straight and stays so."""
    direction, is_bent = atan2(dy, dx), abs(turn) >= STRAIGHT_RAD
    for yaw in yaws:
        is_bent = is_bent or abs(_turn_between(direction, yaw)) >= STRAIGHT_RAD
    if not is_bent:
        return 1
    way_m = hypot(dx, dy) + abs(turn) * axle_m
    return min(max(ceil(way_m / STEP_M), ceil(abs(turn) / BEND_RAD), 1), MOST_STEPS)


@inner
def _pull(yaws: Floats, hitches_m: Floats, dx: float, dy: float) -> None:
    """Pull the trailers along as the robot's axle moves straight by (dx, dy)."""
    for row in range(len(yaws)):
        before = yaws[row]
        yaws[row] = _towed_yaw(before, hitches_m[row], dx, dy)
        dx += hitches_m[row] * (cos(before) - cos(yaws[row]))
        dy += hitches_m[row] * (sin(before) - sin(yaws[row]))


@inner
def _bend(marked: Floats, yaws: Floats) -> float:
    """The greatest turn of a trailer since its headings were `marked`."""
    bend = 0.0
    for row in range(len(yaws)):
        bend = max(bend, abs(_turn_between(marked[row], yaws[row])))
    return bend


@inner
def _write(poses: Floats, at: int, x: float, y: float, yaws: Floats, hitches_m: Floats) -> None:
    """Write the poses of trailers behind an axle at (x, y)."""
    for row in range(len(yaws)):
        x, y = x - hitches_m[row] * cos(yaws[row]), y - hitches_m[row] * sin(yaws[row])
        poses[row, at, 0], poses[row, at, 1], poses[row, at, 2] = x, y, yaws[row]


@inner
def _towed(
    t_s: Floats,
    x_m: Floats,
    y_m: Floats,
    yaw_rad: Floats,
    floor: Ints,
    axle_m: tuple[float, float],
    hitches_m: Floats,
    first_yaws_rad: Floats,
) -> tuple[Floats, Ints, Floats]:
    """Times (k,), floors (k,) and poses (n, k, 3) of n trailers of a robot. They stand where it stands."""
    yaws, marked, kept, room = first_yaws_rad.copy(), first_yaws_rad.copy(), 0, len(t_s) + 64
    times, floors, poses = np.empty(room), np.empty(room, np.int64), np.empty((len(yaws), room, 3))
    for k in range(len(t_s)):
        if k and floor[k] != floor[k - 1]:
            yaws[:] = yaw_rad[k]
        after = k + 1 if k + 1 < len(t_s) and floor[k + 1] == floor[k] else k
        dx, dy, turn = x_m[after] - x_m[k], y_m[after] - y_m[k], _turn_between(yaw_rad[k], yaw_rad[after])
        steps = _steps(dx, dy, turn, hypot(axle_m[0], axle_m[1]), yaws)
        for step in range(steps):
            share, following = step / steps, (step + 1) / steps
            x, y = _axle_at(x_m[k] + share * dx, y_m[k] + share * dy, yaw_rad[k] + share * turn, axle_m)
            if step == 0 or _bend(marked, yaws) >= BEND_RAD:
                if kept == len(times):
                    times, floors = np.concatenate((times, times)), np.concatenate((floors, floors))
                    poses = np.concatenate((poses, poses), 1)
                times[kept], floors[kept] = t_s[k] + share * (t_s[after] - t_s[k]), floor[k]
                _write(poses, kept, x, y, yaws, hitches_m)
                copy_row(yaws, marked)
                kept += 1
            to_yaw = yaw_rad[k] + following * turn
            to_x, to_y = _axle_at(x_m[k] + following * dx, y_m[k] + following * dy, to_yaw, axle_m)
            _pull(yaws, hitches_m, to_x - x, to_y - y)
    return times[:kept].copy(), floors[:kept].copy(), poses[:, :kept].copy()


@kernel((READ_INTS, *[READ_FLOATS] * 4, READ_INTS, INTS, MATRIX, INTS, *[FLOATS] * 2))
def _towed_trains(
    start: Ints,
    t_s: Floats,
    x_m: Floats,
    y_m: Floats,
    yaw_rad: Floats,
    floor: Ints,
    rows: Ints,
    axles_m: Floats,
    begins: Ints,
    hitches_m: Floats,
    yaws_rad: Floats,
) -> tuple[Ints, Floats, Floats, Ints]:
    """The first knot of each trailer, and times (k,), poses (k, 3) and floors (k,) of all, for the trains of `rows`.
    The trailers of train i are `begins[i]` to `begins[i + 1] - 1`."""
    starts, n = np.zeros(begins[-1] + 1, np.int64), 0
    times, poses, floors = np.empty(1024), np.empty((1024, 3)), np.empty(1024, np.int64)
    for train in range(len(rows)):
        knots, own = slice(start[rows[train]], start[rows[train] + 1]), slice(begins[train], begins[train + 1])
        axle_m = axles_m[train, 0], axles_m[train, 1]
        columns = t_s[knots], x_m[knots], y_m[knots], yaw_rad[knots], floor[knots]
        at_s, on_floor, places = _towed(*columns, axle_m, hitches_m[own], yaws_rad[own])
        for trailer in range(len(places)):
            while n + len(at_s) > len(times):
                times, floors = np.concatenate((times, times)), np.concatenate((floors, floors))
                poses = np.concatenate((poses, poses))
            copy_row(at_s, times[n:])
            copy_row(on_floor, floors[n:])
            copy_rows(places[trailer], poses[n:])
            n += len(at_s)
            starts[begins[train] + trailer + 1] = n
    return starts, times[:n].copy(), poses[:n].copy(), floors[:n].copy()
