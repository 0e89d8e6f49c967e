"""Where robots went between their last two reports and will go by their newest forecasts.

Compiled; arrays are by slot, as `followed` keeps them. A report is t_s, x_m, y_m, yaw_rad and floor; a track x_m, y_m,
yaw_rad and floor for every second from its report on. They are read number by number, as numba pays more for a slice
of a few numbers than for what is done with them.
"""

from math import cos, pi, sin
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from ingest.batch import Bools, Floats, Ints
from ingest.kernels import inner, kernel

ROBOT = np.dtype(
    [
        ("kind", np.int64),  # row of its kind of forecast in the ledger
        ("doubt_m", np.float64),  # how far off its position may be as reported
        ("surprise", np.float64),  # by how much its errors exceed the bands of its kind
        ("rests", np.bool_),  # it stood, by its newest forecast, when that was made
        ("stays", np.bool_),  # its newest forecast has it stand for two seconds
        ("leaves", np.bool_),  # its newest forecast has it go at once
        ("stood_since_s", np.float64),  # since when it has stood, by its reports; inf while it moves
    ],
    align=True,
)
"""What is known of a robot."""

Robots = NDArray[Any]
"""Of `ROBOT`."""

ERROR = np.dtype(
    [(name, np.int64) for name in ("kind", "robot", "horizon_s", "radial_bin", "along_bin", "across_bin")]
    + [(name, np.float64) for name in ("radial_m", "along_m", "across_m")]
    + [("bands_m", np.float64, (3,)), ("following", np.bool_)],
    align=True,
)
"""A forecast of one moment, and how far off it was: the row of its kind in the ledger, the caller's own number of the
robot, and whole seconds ahead from 1 on; the size of the error and of its parts, in bins of `sketch` and in metres,
positive where the robot was further along its heading than forecast, and to the left; and the radii of the bands when
the forecast was made; and whether the robot was on its way all the time, and did not stand where it was to go."""

Errors = NDArray[Any]
"""Of `ERROR`."""

_ROBOTS, _ERRORS = (numba.from_dtype(one)[::1] for one in (ROBOT, ERROR))
_INTS, _FLOATS, _MATRIX, _CUBE = numba.int64[::1], numba.float64[::1], numba.float64[:, ::1], numba.float64[:, :, ::1]
_ASKED_LOOKS = numba.types.Array(numba.float64, 1, "A", readonly=True)
CREEPS_MPS, TURNS_RADPS = 0.1, 0.2
"""A robot that goes and turns more slowly stands, by its reports."""
CREEPS_SHARE, STILL_MPS = 0.3, 0.02
"""Unless its forecast is hardly faster: the share of that at which it stands. At this speed every robot stands."""
GOES_MPS = 0.2
"""A forecast by which a robot goes faster has it go."""
Pose = tuple[float, float, float, float]
"""x_m, y_m, yaw_rad and floor."""
Line = tuple[float, float, float, float, float, float, float, float, float]
"""When it begins and how long it lasts; x_m, y_m and yaw_rad, each where it begins and how it changes; and floor."""


@inner
def _turn(yaw: float, other: float) -> float:
    """From one heading to another, the shorter way."""
    turn = other - yaw + pi
    if not 0.0 <= turn < 2 * pi:
        turn %= 2 * pi
    return turn - pi


@inner
def _line(before: Floats, seen: Floats, slot: int, long_ago_s: float, joined_s: float) -> Line:
    """The line of a robot's last two reports; floor -1 where they are not joined."""
    a_s, a_x, a_y, a_yaw = before[slot, 0], before[slot, 1], before[slot, 2], before[slot, 3]
    b_s, b_x, b_y, b_yaw = seen[slot, 0], seen[slot, 1], seen[slot, 2], seen[slot, 3]
    floor = seen[slot, 4]
    if not (a_s > long_ago_s and before[slot, 4] == floor and b_s - a_s <= joined_s):
        a_s, a_x, a_y, a_yaw, floor = b_s, b_x, b_y, b_yaw, -1.0
    return a_s, max(b_s - a_s, 1e-9), a_x, b_x - a_x, a_y, b_y - a_y, a_yaw, _turn(a_yaw, b_yaw), floor


@inner
def _on(line: Line, t_s: float) -> Pose:
    """Where a robot was on its line."""
    begin_s, lasts_s, x, goes_x, y, goes_y, yaw, turns, floor = line
    share = (t_s - begin_s) / lasts_s
    share = 0.0 if share < 0.0 else 1.0 if share > 1.0 else share
    return x + share * goes_x, y + share * goes_y, yaw + share * turns, floor


@inner
def _speed_mps(before: Floats, seen: Floats, slot: int, joined_s: float) -> float:
    """At which a robot went from its last report but one to the last; nan where that is not known."""
    lasted_s = seen[slot, 0] - before[slot, 0]
    if not (0.0 < lasted_s <= joined_s and before[slot, 4] == seen[slot, 4]):
        return float(np.nan)
    return float(np.hypot(seen[slot, 1] - before[slot, 1], seen[slot, 2] - before[slot, 2]) / lasted_s)


@kernel(numba.float64(*[_MATRIX] * 2, numba.int64, numba.float64))
def speed_mps(before: Floats, seen: Floats, slot: int, joined_s: float) -> float:
    """See `_speed_mps`."""
    return _speed_mps(before, seen, slot, joined_s)


@inner
def _part(track: Floats, slot: int, since_s: float) -> tuple[int, float]:
    """The sample of its track that a robot has reached so long after its report, and how much of the way to the
    next."""
    last = track.shape[1] - 1
    since_s = min(max(since_s, 0.0), float(last))
    whole = min(int(since_s), last - 1)
    return whole, since_s - whole if track[slot, whole, 3] == track[slot, whole + 1, 3] else 0.0


@inner
def _ahead(track: Floats, slot: int, since_s: float) -> Pose:
    """Where a robot is so long after the report of its track; linear between its samples."""
    whole, share = _part(track, slot, since_s)
    x, y, yaw = track[slot, whole, 0], track[slot, whole, 1], track[slot, whole, 2]
    x += share * (track[slot, whole + 1, 0] - x)
    y += share * (track[slot, whole + 1, 1] - y)
    return x, y, yaw + share * _turn(yaw, track[slot, whole + 1, 2]), track[slot, whole, 3]


@kernel(
    numba.types.Tuple((*[_MATRIX] * 5, numba.boolean[:, ::1], _MATRIX))(  # type: ignore[no-untyped-call]
        *[_MATRIX] * 2, _CUBE, *[_INTS] * 2, *[_ASKED_LOOKS] * 2, *[numba.float64] * 3, _MATRIX
    )
)
def beside(
    before: Floats,
    seen: Floats,
    track: Floats,
    a: Ints,
    b: Ints,
    past_looks: Floats,
    ahead_s: Floats,
    now_s: float,
    long_ago_s: float,
    joined_s: float,
    late_s: Floats,
) -> tuple[Floats, Floats, Floats, Floats, Floats, Bools, Floats]:
    """Robots `b` (n,) as seen from `a` (n,), when they start `late_s` (2, n) later than they forecast.

    They are looked at at `past_looks` (k,), parts of the time since the last look for which both have reported, and at
    `now_s + ahead_s` (m,).

    These times of the past (n, k), nan where there are none; dx, dy, headings of both and whether they are on one floor
    (n, k + m); and (2, n) the speeds at which each goes on until the second look ahead.
    """
    n, past, looks = len(a), len(past_looks), len(past_looks) + len(ahead_s)
    past_s, speeds, same = np.empty((n, past)), np.empty((2, n)), np.empty((n, looks), np.bool_)
    dx, dy, yaw_a, yaw_b = np.empty((n, looks)), np.empty((n, looks)), np.empty((n, looks)), np.empty((n, looks))
    x, y, yaw, floor = np.empty((2, looks)), np.empty((2, looks)), np.empty((2, looks)), np.empty((2, looks))
    for row in range(n):
        begin_s, end_s = long_ago_s, np.inf
        for slot in (a[row], b[row]):
            if before[slot, 0] >= seen[slot, 0] - joined_s:
                begin_s = max(begin_s, before[slot, 0])
            end_s = min(end_s, seen[slot, 0])
        begin_s = begin_s if begin_s > long_ago_s else end_s
        end_s = end_s if begin_s <= end_s else np.nan
        for at in range(past):
            past_s[row, at] = begin_s + (end_s - begin_s) * past_looks[at]
        for side in (0, 1):
            slot = a[row] if side == 0 else b[row]
            line = _line(before, seen, slot, long_ago_s, joined_s)
            for at in range(looks):
                if at < past:
                    pose = _on(line, past_s[row, at])
                else:
                    pose = _ahead(track, slot, now_s + ahead_s[at - past] - seen[slot, 0] - late_s[side, row])
                x[side, at], y[side, at], yaw[side, at], floor[side, at] = pose
            goes_x, goes_y = x[side, past + 1] - x[side, past], y[side, past + 1] - y[side, past]
            speeds[side, row] = np.hypot(goes_x, goes_y) / ahead_s[1]
        for at in range(looks):
            dx[row, at], dy[row, at] = x[1, at] - x[0, at], y[1, at] - y[0, at]
            yaw_a[row, at], yaw_b[row, at] = yaw[0, at], yaw[1, at]
            same[row, at] = floor[0, at] == floor[1, at] and floor[0, at] >= 0.0
    return past_s, dx, dy, yaw_a, yaw_b, same, speeds


@inner
def _set_around(around: Floats, track: Floats, slot: int) -> None:
    """The box around a robot's track, x_m, y_m and half sides, and its longest step."""
    low_x = high_x = track[slot, 0, 0]
    low_y = high_y = track[slot, 0, 1]
    step = 0.0
    for at in range(1, track.shape[1]):
        x, y = track[slot, at, 0], track[slot, at, 1]
        low_x, high_x, low_y, high_y = min(low_x, x), max(high_x, x), min(low_y, y), max(high_y, y)
        step = max(step, np.hypot(x - track[slot, at - 1, 0], y - track[slot, at - 1, 1]))
    around[slot, 0], around[slot, 1] = (low_x + high_x) / 2, (low_y + high_y) / 2
    around[slot, 2], around[slot, 3], around[slot, 4] = (high_x - low_x) / 2, (high_y - low_y) / 2, step


@inner
def _hear(before: Floats, seen: Floats, track: Floats, slot: int, event_s: float, told: Floats, row: int) -> None:
    for part in range(5):
        before[slot, part] = seen[slot, part]
        seen[slot, part] = told[row, 0, part - 1] if part else event_s
    for at in range(told.shape[1]):
        for part in range(4):
            track[slot, at, part] = told[row, at, part]


@inner
def _place(made_s: Floats, following: Ints, slot: int, event_s: float, spaced_s: float) -> int:
    """The place of a robot's oldest forecast, where its new one goes; -1 where the last was made less than `spaced_s`
    before."""
    last_s = -np.inf
    for made in range(made_s.shape[1]):
        last_s = max(last_s, made_s[slot, made])
    if not event_s - last_s >= spaced_s:
        return -1
    place = int(following[slot])
    made_s[slot, place], following[slot] = event_s, (place + 1) % made_s.shape[1]
    return place


@inner
def _keep(
    foretold: Floats, bands_m: Floats, slot: int, place: int, told: Floats, row: int, of_kinds_m: Floats, kind: int
) -> None:
    for second in range(foretold.shape[2]):
        for part in range(4):
            foretold[slot, place, second, part] = told[row, second + 1, part]
        for band in range(3):
            bands_m[slot, place, second, band] = of_kinds_m[kind, second, band]


@inner
def _is_known(told: Floats, row: int) -> bool:
    """Whether a track says where its robot will be throughout."""
    for at in range(told.shape[1]):
        for part in range(4):
            if not np.isfinite(told[row, at, part]):
                return False
    return True


@inner
def _rests(told: Floats, row: int, standing_mps: float) -> bool:
    """Whether a robot stands for the first second of its track."""
    return bool(np.hypot(told[row, 1, 0] - told[row, 0, 0], told[row, 1, 1] - told[row, 0, 1]) < standing_mps)


@inner
def _goes_mps(track: Floats, slot: int, after_s: float) -> float:
    """How fast a track has its robot go so long after its first sample."""
    at = min(max(int(after_s), 0), track.shape[1] - 2)
    return float(np.hypot(track[slot, at + 1, 0] - track[slot, at, 0], track[slot, at + 1, 1] - track[slot, at, 1]))


@inner
def _stood_since_s(
    before: Floats, seen: Floats, slot: int, since_s: float, joined_s: float, forecast_mps: float
) -> float:
    """Since when a robot has stood, by its last two reports, when its forecast has it go so fast; inf where it moves or
    turns."""
    lasted_s = seen[slot, 0] - before[slot, 0]
    if not (0.0 < lasted_s <= joined_s and before[slot, 4] == seen[slot, 4]):
        return since_s
    went_m = np.hypot(seen[slot, 1] - before[slot, 1], seen[slot, 2] - before[slot, 2])
    creeps_mps = max(min(CREEPS_MPS, CREEPS_SHARE * forecast_mps), STILL_MPS)
    if went_m >= creeps_mps * lasted_s or abs(_turn(before[slot, 3], seen[slot, 3])) >= TURNS_RADPS * lasted_s:
        return float(np.inf)
    return float(min(since_s, before[slot, 0]))


@inner
def _stop(stopped: Bools, made_s: Floats, foretold: Floats, seen: Floats, slot: int) -> None:
    """Mark the forecasts that have a robot go where it stands now."""
    for made in range(made_s.shape[1]):
        after_s = seen[slot, 0] - made_s[slot, made]
        last = foretold.shape[2] - 1
        second = min(max(int(after_s) - 1, 0), last - 1)
        dx = foretold[slot, made, second + 1, 0] - foretold[slot, made, second, 0]
        dy = foretold[slot, made, second + 1, 1] - foretold[slot, made, second, 1]
        if np.hypot(dx, dy) > GOES_MPS:
            stopped[slot, made] = True


@inner
def _bin(limits_m: Floats, size_m: float) -> int:
    """The bin of an error, as `sketch.bins` has it; halved without a branch, as nothing is known of the next size."""
    found = 0
    for step in (64, 32, 16, 8, 4, 2, 1):
        found += step if limits_m[found + step - 1] < size_m else 0
    return found


@inner
def _set_off(error: Any, along_m: float, across_m: float, limits_m: Floats) -> None:
    """How far off a forecast was, and the bins of that."""
    radial_m = np.hypot(along_m, across_m)
    error.along_m, error.across_m, error.radial_m = along_m, across_m, radial_m
    error.radial_bin = _bin(limits_m, radial_m)
    error.along_bin, error.across_bin = _bin(limits_m, abs(along_m)), _bin(limits_m, abs(across_m))


@kernel(
    numba.types.Tuple((_ERRORS, numba.boolean[::1]))(  # type: ignore[no-untyped-call]
        _ROBOTS,
        *[_MATRIX] * 3,
        _CUBE,
        *[_MATRIX] * 2,
        numba.boolean[:, ::1],
        _INTS,
        numba.int64[:, ::1],
        *[numba.float64[:, :, :, ::1]] * 2,
        *[_INTS] * 2,
        *[_ASKED_LOOKS] * 4,
        *[_CUBE] * 2,
        _ASKED_LOOKS,
        *[numba.float64] * 4,
    )
)
def take(
    robots: Robots,
    half: Floats,
    before: Floats,
    seen: Floats,
    track: Floats,
    around: Floats,
    made_s: Floats,
    stopped: Bools,
    following: Ints,
    kind: Ints,
    foretold: Floats,
    bands_m: Floats,
    slots: Ints,
    kinds: Ints,
    event_s: Floats,
    doubt_m: Floats,
    length_m: Floats,
    width_m: Floats,
    told: Floats,
    of_kinds_m: Floats,
    limits_m: Floats,
    long_ago_s: float,
    joined_s: float,
    spaced_s: float,
    standing_mps: float,
) -> tuple[Errors, Bools]:
    """Take in what robots of `slots` (n,), all different, said of themselves at `event_s` (n,), with their tracks
    `told` (n, k, 4): forecasts of `kinds` (n,), whose bands are `of_kinds_m` (kinds, horizons, 3). A track that does
    not say where its robot will be is left out, and one that is no newer than what was `seen`.

    The errors of what was foretold of the moments since the report before; their bins hold at the most
    `limits_m`. And whether each robot stands, (n,): by its forecast, or by its last two reports.
    Forecasts are kept to be held to account so, made at `made_s` (slots, kept), if the last was `spaced_s` before;
    those by which a robot was to go while it stood are `stopped` (slots, kept).
    """
    kept, horizons = made_s.shape[1], foretold.shape[2]
    errors, found = np.empty(len(slots) * kept * (int(joined_s) + 1), ERROR), 0
    stands = np.zeros(len(slots), np.bool_)
    for row, slot in enumerate(slots):
        robots[slot].kind, robots[slot].doubt_m = kinds[row], doubt_m[row]
        half[0, slot], half[1, slot] = length_m[row] / 2, width_m[row] / 2
        if not _is_known(told, row):
            continue
        rests = robots[slot].rests = _rests(told, row, standing_mps)
        stands[row] = rests or _speed_mps(before, seen, slot, joined_s) < standing_mps
        if not event_s[row] > seen[slot, 0]:
            continue
        _hear(before, seen, track, slot, event_s[row], told, row)
        _set_around(around, track, slot)
        stands[row] = rests or _speed_mps(before, seen, slot, joined_s) < standing_mps
        before_s, seen_s = before[slot, 0], seen[slot, 0]
        forecast_mps = max(_goes_mps(track, slot, 0.0), _goes_mps(track, slot, 1.0))
        since_s = robots[slot].stood_since_s
        robots[slot].stood_since_s = _stood_since_s(before, seen, slot, since_s, joined_s, forecast_mps)
        robots[slot].leaves, robots[slot].stays = forecast_mps > GOES_MPS, forecast_mps < STILL_MPS
        waits = robots[slot].stood_since_s < np.inf
        if waits:
            _stop(stopped, made_s, foretold, seen, slot)
        is_joined = before_s > long_ago_s and before_s >= seen_s - joined_s
        line = _line(before, seen, slot, long_ago_s, joined_s)
        yaw, c, s = 0.0, 1.0, 0.0
        for made in range(kept if is_joined else 0):
            first = max(int(before_s - made_s[slot, made]) - 1, 0)
            for second in range(first, min(int(seen_s - made_s[slot, made]) + 1, horizons)):
                moment_s = made_s[slot, made] + (second + 1.0)
                if not before_s < moment_s <= seen_s:
                    continue
                x, y = foretold[slot, made, second, 0], foretold[slot, made, second, 1]
                turned, floor = foretold[slot, made, second, 2], foretold[slot, made, second, 3]
                was_x, was_y, _, was_floor = _on(line, moment_s)
                if floor != was_floor or floor < 0.0:
                    continue
                if turned != yaw:
                    yaw, c, s = turned, cos(turned), sin(turned)
                dx, dy = was_x - x, was_y - y
                error = errors[found]
                error.kind, error.robot, error.horizon_s = kind[slot, made], slot, second + 1
                error.following = not stopped[slot, made]
                _set_off(error, c * dx + s * dy, c * dy - s * dx, limits_m)
                for band in range(3):
                    error.bands_m[band] = bands_m[slot, made, second, band]
                found += 1
        place = _place(made_s, following, slot, event_s[row], spaced_s)
        if place >= 0:
            kind[slot, place], stopped[slot, place] = kinds[row], waits and robots[slot].leaves
            _keep(foretold, bands_m, slot, place, told, row, of_kinds_m, kinds[row])
    return errors[:found].copy(), stands
