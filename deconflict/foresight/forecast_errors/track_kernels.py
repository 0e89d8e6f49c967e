"""Where robots went between their last two reports, and where they will go by their newest forecasts.

A report is t_s, x_m, y_m, yaw_rad and floor. A track is x_m, y_m, yaw_rad and floor for every second from its report
on.

The file is long because its functions are compiled: they read reports number by number, as a slice of a few numbers
costs more in numba than the arithmetic on it.
"""

from math import cos, sin
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.foresight.forecast_errors.upper_quantiles import LIMITS_M
from deconflict.foresight.motion_assumptions import JOINED_S, SPACED_S
from deconflict.sweep.geometry.encounter import STANDING_MPS
from deconflict.sweep.geometry.envelope_distances import signed_gap
from ingest.batch import Bools, Floats, Ints
from ingest.frames.angles import turn_between
from ingest.kernels import (
    ANY_FLOATS,
    BOOL_MATRIX,
    CUBE,
    CUBES,
    FLOAT,
    INT,
    INT_MATRIX,
    INTS,
    MATRIX,
    inner,
    kernel,
    named_type,
)

ROBOT = np.dtype(
    [
        ("kind", np.int64),  # row of its kind of forecast in the ledger
        ("doubt_m", np.float64),  # how far off its reported position may be
        ("surprise", np.float64),  # by how many times its errors exceed the bands of its kind
        ("rests", np.bool_),  # by its newest forecast it stood when that was made
        ("stays", np.bool_),  # by its newest forecast it stands for two seconds
        ("leaves", np.bool_),  # by its newest forecast it goes at once
        ("stood_since_s", np.float64),  # since when it has stood by its reports, inf while it moves
    ],
    align=True,
)
"""What is known of a robot."""

Robots = NDArray[Any]
"""Of `ROBOT`."""

ERROR = np.dtype(
    [
        ("kind", np.int64),  # row of its kind in the ledger
        ("robot", np.int64),  # slot
        ("horizon_s", np.int64),  # whole seconds ahead, from 1 on
        ("radial_bin", np.int64),  # bin of the size of the error, see `upper_quantiles`
        ("along_bin", np.int64),  # bin of its part along the heading
        ("across_bin", np.int64),  # bin of its part across the heading
        ("radial_m", np.float64),  # size of the error
        ("along_m", np.float64),  # part along the forecast heading, positive if the robot was further ahead
        ("across_m", np.float64),  # part across it, positive to the left
        ("bands_m", np.float64, (3,)),  # radii of the bands when the forecast was made
        ("following", np.bool_),  # the robot was on its way all the time: it did not stand where it was to move
    ],
    align=True,
)
"""The error of a forecast of one moment."""

Errors = NDArray[Any]
"""Of `ERROR`."""


class ReportHistory(NamedTuple):
    """The last two reports of each robot, by slot, and the forecasts that are kept of it, by `row`."""

    newest: Floats
    """(slots, 5) the newest report."""
    previous: Floats
    """(slots, 5) the report before it."""
    track: Floats
    """(slots, k, 4) the track of the newest report."""
    around: Floats
    """(slots, 5) a box around the track: x_m and y_m of its centre, its half sides, and the longest distance that the
    robot goes in a second."""
    row: Ints
    """(slots,) the row of its kept forecasts; -1 for a robot that rests. A robot that reports has one."""
    made_s: Floats
    """(rows, kept) when each kept forecast was made."""
    stopped: Bools
    """(rows, kept) whether the robot has stood at a time when this forecast had it move."""
    next_index: Ints
    """(rows,) the place of the next forecast among the kept ones."""
    kind: Ints
    """(rows, kept) the ledger row of each kept forecast."""
    forecast: Floats
    """(rows, kept, horizons, 4) x_m, y_m, yaw_rad and floor that were forecast."""
    bands_m: Floats
    """(rows, kept, horizons, 3) radii of the bands when the forecast was made."""


class Looks(NamedTuple):
    """The moments at which n pairs of robots are looked at."""

    past: Floats
    """(k,) parts of the last span of time for which both have reported."""
    ahead_s: Floats
    """(m,) seconds after `now_s`."""
    now_s: float
    late_s: Floats
    """(2, n) how much later than they forecast the robots start."""


class RelativePoses(NamedTuple):
    """n pairs of robots, at k moments of the past and m moments ahead. Arrays are (n, k + m) unless
    stated otherwise."""

    past_s: Floats
    """(n, k) the moments of the past; nan if the two have no time in common."""
    dx_m: Floats
    """From the centre of the first robot of the pair to that of the second, along x and along y of their floor."""
    dy_m: Floats
    yaw_a_rad: Floats
    """Heading of the first robot, anticlockwise from x, and of the second."""
    yaw_b_rad: Floats
    is_same_floor: Bools
    """Whether both are known to be on one floor."""
    speed_mps: Floats
    """(2, n) speed of each robot now, by its forecast."""

    def separations_m(self, half_a_m: Floats, half_b_m: Floats) -> Floats:
        """(n, k + m) distance of the two envelopes, negative if they overlap. `half_a_m` and `half_b_m` (2, n) are
        their half sides."""
        return signed_gap(self.dx_m, self.dy_m, self.yaw_a_rad, self.yaw_b_rad, half_a_m, half_b_m)


LONG_AGO_S = -1e12
"""Before any report."""

_ROBOTS, _ERRORS = (numba.from_dtype(dtype)[::1] for dtype in (ROBOT, ERROR))
_HISTORY = named_type(
    ReportHistory, *[MATRIX] * 2, CUBE, MATRIX, INTS, MATRIX, BOOL_MATRIX, INTS, INT_MATRIX, *[CUBES] * 2
)
POSES = named_type(RelativePoses, *[MATRIX] * 5, BOOL_MATRIX, MATRIX)
"""The type of `RelativePoses` in kernels."""
CREEPS_MPS, TURNS_RADPS = 0.1, 0.2
"""By its reports, a robot that moves and turns more slowly stands."""
CREEPS_SHARE, STILL_MPS = 0.3, 0.02
"""If the forecast is slow itself, a robot stands below this share of the forecast speed. Below the second speed every
robot stands."""
GOES_MPS = 0.2
"""A faster forecast means that the robot moves."""
Pose = tuple[float, float, float, float]
"""x_m, y_m, yaw_rad and floor."""
Line = tuple[float, float, float, float, float, float, float, float, float]
"""Motion between two reports: begin and duration in seconds; x_m, change of x_m, y_m, change of y_m, yaw_rad, change of
yaw_rad; floor."""


_turn_between = inner(turn_between)


@inner
def _line(history: ReportHistory, slot: int) -> Line:
    """The motion between a robot's last two reports; floor -1 if they are too far apart in time or on two floors."""
    previous, newest = history.previous, history.newest
    a_s, a_x, a_y, a_yaw = previous[slot, 0], previous[slot, 1], previous[slot, 2], previous[slot, 3]
    b_s, b_x, b_y, b_yaw = newest[slot, 0], newest[slot, 1], newest[slot, 2], newest[slot, 3]
    floor = newest[slot, 4]
    if not (a_s > LONG_AGO_S and previous[slot, 4] == floor and b_s - a_s <= JOINED_S):
        a_s, a_x, a_y, a_yaw, floor = b_s, b_x, b_y, b_yaw, -1.0
    return a_s, max(b_s - a_s, 1e-9), a_x, b_x - a_x, a_y, b_y - a_y, a_yaw, _turn_between(a_yaw, b_yaw), floor


@inner
def _on(line: Line, t_s: float) -> Pose:
    """Where a robot was on its line at `t_s`."""
    begin_s, lasts_s, x, goes_x, y, goes_y, yaw, turns, floor = line
    share = (t_s - begin_s) / lasts_s
    share = 0.0 if share < 0.0 else 1.0 if share > 1.0 else share
    return x + share * goes_x, y + share * goes_y, yaw + share * turns, floor


@inner
def _speed_mps(history: ReportHistory, slot: int) -> float:
    """Speed of a robot between its last two reports; nan if unknown."""
    previous, newest = history.previous, history.newest
    lasted_s = newest[slot, 0] - previous[slot, 0]
    if not (0.0 < lasted_s <= JOINED_S and previous[slot, 4] == newest[slot, 4]):
        return float(np.nan)
    return float(np.hypot(newest[slot, 1] - previous[slot, 1], newest[slot, 2] - previous[slot, 2]) / lasted_s)


@kernel(FLOAT(_HISTORY, INT))
def speed_mps(history: ReportHistory, slot: int) -> float:
    """See `_speed_mps`."""
    return _speed_mps(history, slot)


@inner
def on_track(track: Floats, slot: int, since_s: float) -> Pose:
    """Where a robot is `since_s` after the report of its track, linear between the samples."""
    last = track.shape[1] - 1
    since_s = min(max(since_s, 0.0), float(last))
    whole = min(int(since_s), last - 1)
    share = since_s - whole if track[slot, whole, 3] == track[slot, whole + 1, 3] else 0.0
    x, y, yaw = track[slot, whole, 0], track[slot, whole, 1], track[slot, whole, 2]
    x += share * (track[slot, whole + 1, 0] - x)
    y += share * (track[slot, whole + 1, 1] - y)
    return x, y, yaw + share * _turn_between(yaw, track[slot, whole + 1, 2]), track[slot, whole, 3]


@kernel(POSES(_HISTORY, *[INTS] * 2, *[ANY_FLOATS] * 2, FLOAT, MATRIX))
def relative_poses(
    history: ReportHistory, a: Ints, b: Ints, past_looks: Floats, ahead_s: Floats, now_s: float, late_s: Floats
) -> RelativePoses:
    """Robots `b` (n,) as seen from `a` (n,), if they start `late_s` (2, n) later than they forecast.

    The moments are `past_looks` (k,), as parts of the last span of time for which both have reported, and
    `now_s + ahead_s` (m,).

    The moments of the past are nan if a pair has none; its speeds are those until the second moment ahead.
    """
    previous, newest, track = history.previous, history.newest, history.track
    n, past, looks = len(a), len(past_looks), len(past_looks) + len(ahead_s)
    past_s, speeds, is_same_floor = np.empty((n, past)), np.empty((2, n)), np.empty((n, looks), np.bool_)
    dx, dy, yaw_a, yaw_b = np.empty((n, looks)), np.empty((n, looks)), np.empty((n, looks)), np.empty((n, looks))
    x, y, yaw, floor = np.empty((2, looks)), np.empty((2, looks)), np.empty((2, looks)), np.empty((2, looks))
    for row in range(n):
        begin_s, end_s = LONG_AGO_S, np.inf
        for slot in (a[row], b[row]):
            if previous[slot, 0] >= newest[slot, 0] - JOINED_S:
                begin_s = max(begin_s, previous[slot, 0])
            end_s = min(end_s, newest[slot, 0])
        begin_s = begin_s if begin_s > LONG_AGO_S else end_s
        end_s = end_s if begin_s <= end_s else np.nan
        for at in range(past):
            past_s[row, at] = begin_s + (end_s - begin_s) * past_looks[at]
        for side in (0, 1):
            slot = a[row] if side == 0 else b[row]
            line = _line(history, slot)
            for at in range(looks):
                if at < past:
                    pose = _on(line, past_s[row, at])
                else:
                    pose = on_track(track, slot, now_s + ahead_s[at - past] - newest[slot, 0] - late_s[side, row])
                x[side, at], y[side, at], yaw[side, at], floor[side, at] = pose
            goes_x, goes_y = x[side, past + 1] - x[side, past], y[side, past + 1] - y[side, past]
            speeds[side, row] = np.hypot(goes_x, goes_y) / ahead_s[1]
        for at in range(looks):
            dx[row, at], dy[row, at] = x[1, at] - x[0, at], y[1, at] - y[0, at]
            yaw_a[row, at], yaw_b[row, at] = yaw[0, at], yaw[1, at]
            is_same_floor[row, at] = floor[0, at] == floor[1, at] and floor[0, at] >= 0.0
    return RelativePoses(past_s, dx, dy, yaw_a, yaw_b, is_same_floor, speeds)


@inner
def _set_around(history: ReportHistory, slot: int) -> None:
    """Set the box around a robot's track, and its longest step."""
    around, track = history.around, history.track
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
def _store_report(history: ReportHistory, slot: int, event_s: float, tracks: Floats, row: int) -> None:
    previous, newest, track = history.previous, history.newest, history.track
    for part in range(5):
        previous[slot, part] = newest[slot, part]
        newest[slot, part] = tracks[row, 0, part - 1] if part else event_s
    for at in range(tracks.shape[1]):
        for part in range(4):
            track[slot, at, part] = tracks[row, at, part]


@inner
def _reserve_index(history: ReportHistory, own: int, event_s: float) -> int:
    """Reserve the place of the oldest forecast of row `own` for a new one. Returns -1 if the last one was made less
    than `SPACED_S` before."""
    made_s, next_index = history.made_s, history.next_index
    last_s = -np.inf
    for made in range(made_s.shape[1]):
        last_s = max(last_s, made_s[own, made])
    if not event_s - last_s >= SPACED_S:
        return -1
    place = int(next_index[own])
    made_s[own, place], next_index[own] = event_s, (place + 1) % made_s.shape[1]
    return place


@inner
def _store_forecast(
    history: ReportHistory, own: int, place: int, tracks: Floats, row: int, kind_bands_m: Floats, kind: int
) -> None:
    bands_m = history.bands_m
    history.kind[own, place] = kind
    for second in range(history.forecast.shape[2]):
        for part in range(4):
            history.forecast[own, place, second, part] = tracks[row, second + 1, part]
        for band in range(3):
            bands_m[own, place, second, band] = kind_bands_m[kind, second, band]


@inner
def _is_known(tracks: Floats, row: int) -> bool:
    """Whether all numbers of a track are finite."""
    for at in range(tracks.shape[1]):
        for part in range(4):
            if not np.isfinite(tracks[row, at, part]):
                return False
    return True


@inner
def _rests(tracks: Floats, row: int) -> bool:
    """Whether a robot stands for the first second of its track."""
    return bool(np.hypot(tracks[row, 1, 0] - tracks[row, 0, 0], tracks[row, 1, 1] - tracks[row, 0, 1]) < STANDING_MPS)


@inner
def _track_mps(track: Floats, slot: int, after_s: float) -> float:
    """Speed of a robot on its track, `after_s` after the first sample."""
    at = min(max(int(after_s), 0), track.shape[1] - 2)
    return float(np.hypot(track[slot, at + 1, 0] - track[slot, at, 0], track[slot, at + 1, 1] - track[slot, at, 1]))


@inner
def _turns_ahead(track: Floats, slot: int) -> bool:
    """Whether a robot turns on its track, seconds of which are TURNS_RADPS apart or more."""
    for at in range(track.shape[1] - 1):
        if abs(_turn_between(track[slot, at, 2], track[slot, at + 1, 2])) >= TURNS_RADPS:
            return True
    return False


@inner
def _stood_since_s(history: ReportHistory, slot: int, since_s: float, forecast_mps: float) -> float:
    """Since when a robot has stood, by its last two reports and by the speed of its forecast; inf if it moves or
    turns."""
    previous, newest = history.previous, history.newest
    lasted_s = newest[slot, 0] - previous[slot, 0]
    if not (0.0 < lasted_s <= JOINED_S and previous[slot, 4] == newest[slot, 4]):
        return since_s
    went_m = np.hypot(newest[slot, 1] - previous[slot, 1], newest[slot, 2] - previous[slot, 2])
    creeps_mps = max(min(CREEPS_MPS, CREEPS_SHARE * forecast_mps), STILL_MPS)
    turned_rad = abs(_turn_between(previous[slot, 3], newest[slot, 3]))
    if went_m >= creeps_mps * lasted_s or turned_rad >= TURNS_RADPS * lasted_s:
        return float(np.inf)
    return float(min(since_s, previous[slot, 0]))


@inner
def _mark_stopped(history: ReportHistory, slot: int) -> None:
    """Mark the forecasts by which a robot moves now, although it stands."""
    forecast, own = history.forecast, history.row[slot]
    for made in range(history.made_s.shape[1]):
        after_s = history.newest[slot, 0] - history.made_s[own, made]
        last = forecast.shape[2] - 1
        second = min(max(int(after_s) - 1, 0), last - 1)
        dx = forecast[own, made, second + 1, 0] - forecast[own, made, second, 0]
        dy = forecast[own, made, second + 1, 1] - forecast[own, made, second, 1]
        if np.hypot(dx, dy) > GOES_MPS:
            history.stopped[own, made] = True


@inner
def _bin(size_m: float) -> int:
    """The bin of an error, as of `upper_quantiles.bins`. The halving has no branch, as the next size is
    unpredictable."""
    found = 0
    for step in (64, 32, 16, 8, 4, 2, 1):
        found += step if LIMITS_M[found + step - 1] < size_m else 0
    return found


@inner
def _set_error(error: Any, along_m: float, across_m: float) -> None:
    """Set the parts of an error, and their bins."""
    radial_m = np.hypot(along_m, across_m)
    error.along_m, error.across_m, error.radial_m = along_m, across_m, radial_m
    error.radial_bin = _bin(radial_m)
    error.along_bin, error.across_bin = _bin(abs(along_m)), _bin(abs(across_m))


@kernel((_ROBOTS, MATRIX, _HISTORY, *[INTS] * 2, *[ANY_FLOATS] * 4, *[CUBE] * 2))
def add_reports(
    robots: Robots,
    half_m: Floats,
    history: ReportHistory,
    slots: Ints,
    kinds: Ints,
    event_s: Floats,
    doubt_m: Floats,
    length_m: Floats,
    width_m: Floats,
    tracks: Floats,
    kind_bands_m: Floats,
) -> tuple[Errors, Bools]:
    """Take in reports of robots `slots` (n,), all different: at `event_s` (n,), with the forecast `tracks` (n, k, 4).

    `kinds` (n,) are the ledger rows of the forecasts, and `kind_bands_m` (kinds, horizons, 3) the bands of the ledger.
    A report is left out if its track is not finite throughout, or if it is not later than the newest one. Its
    forecast is kept, to be compared with later reports, if the last kept one was made at least `SPACED_S` before.

    Returns the errors of the kept forecasts for the moments since the report before; and (n,) whether each robot
    stands, by its forecast or by its last two reports.
    """
    previous, newest, made_s, forecast = history.previous, history.newest, history.made_s, history.forecast
    kept, horizons = made_s.shape[1], forecast.shape[2]
    errors, found = np.empty(len(slots) * kept * (int(JOINED_S) + 1), ERROR), 0
    stands = np.zeros(len(slots), np.bool_)
    for row, slot in enumerate(slots):
        robots[slot].kind, robots[slot].doubt_m = kinds[row], doubt_m[row]
        half_m[0, slot], half_m[1, slot] = length_m[row] / 2, width_m[row] / 2
        if not _is_known(tracks, row):
            continue
        rests = robots[slot].rests = _rests(tracks, row)
        stands[row] = rests or _speed_mps(history, slot) < STANDING_MPS
        if not event_s[row] > newest[slot, 0]:
            continue
        _store_report(history, slot, event_s[row], tracks, row)
        _set_around(history, slot)
        stands[row] = rests or _speed_mps(history, slot) < STANDING_MPS
        previous_s, newest_s = previous[slot, 0], newest[slot, 0]
        forecast_mps = max(_track_mps(history.track, slot, 0.0), _track_mps(history.track, slot, 1.0))
        since_s = robots[slot].stood_since_s
        robots[slot].stood_since_s = _stood_since_s(history, slot, since_s, forecast_mps)
        robots[slot].leaves, robots[slot].stays = forecast_mps > GOES_MPS, forecast_mps < STILL_MPS
        robots[slot].stays = robots[slot].stays and not _turns_ahead(history.track, slot)
        waits = robots[slot].stood_since_s < np.inf
        if waits:
            _mark_stopped(history, slot)
        own, is_joined = history.row[slot], previous_s > LONG_AGO_S and previous_s >= newest_s - JOINED_S
        line = _line(history, slot)
        yaw, c, s = 0.0, 1.0, 0.0
        for made in range(kept if is_joined else 0):
            first = max(int(previous_s - made_s[own, made]) - 1, 0)
            for second in range(first, min(int(newest_s - made_s[own, made]) + 1, horizons)):
                moment_s = made_s[own, made] + (second + 1.0)
                if not previous_s < moment_s <= newest_s:
                    continue
                x, y = forecast[own, made, second, 0], forecast[own, made, second, 1]
                turned, floor = forecast[own, made, second, 2], forecast[own, made, second, 3]
                was_x, was_y, _, was_floor = _on(line, moment_s)
                if floor != was_floor or floor < 0.0:
                    continue
                if turned != yaw:
                    yaw, c, s = turned, cos(turned), sin(turned)
                dx, dy = was_x - x, was_y - y
                error = errors[found]
                error.kind, error.robot, error.horizon_s = history.kind[own, made], slot, second + 1
                error.following = not history.stopped[own, made]
                _set_error(error, c * dx + s * dy, c * dy - s * dx)
                for band in range(3):
                    error.bands_m[band] = history.bands_m[own, made, second, band]
                found += 1
        place = _reserve_index(history, own, event_s[row])
        if place >= 0:
            history.stopped[own, place] = waits and robots[slot].leaves
            _store_forecast(history, own, place, tracks, row, kind_bands_m, kinds[row])
    return errors[:found].copy(), stands
