"""How robots get on along the ways that they forecast, and where one of them gives way.

Compiled; arrays are by slot. A robot's history holds its newest reports, each with the forecast that came with it. The
delay of a report against an earlier forecast is how much later the robot is where it is than that forecast said.
A robot brakes where its delay grows by a second within five, and it goes much more slowly than before. It swerves where
it leaves the forecast way by more than half its width.
"""

from math import hypot, inf, sqrt
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from ingest.batch import Bools, Floats, Ints
from ingest.kernels import inner, kernel

KEPT = 12
"""InteractionReports of a robot that its history holds."""
SPACED_S = 0.9
"""A report is kept only so long after the one kept before."""
AHEAD_S = 10
"""Whole seconds for which the forecast of a kept report is kept; sample 0 is the report itself."""
SPARSE_S = 2.1
"""InteractionReports further apart say nothing of the motion between them."""
EARLIER_S, EARLIEST_S = 2.0, 4.0
"""A report is compared with the newest forecast made at least so long before it, and at most so long."""
WITHIN_S = 5.0
"""A robot gives way where it loses `LOST_S` within this time."""
LOST_S = 1.0
MOVES_MPS = 0.3
"""A robot that goes more slowly has no way to give."""
SLOWS, BRAKES = 0.85, 0.6
"""Shares of its speed that a braking robot falls below at its next report, and at any until it is noticed."""
BRAKES_MPS2 = 1.0
"""At which robots are taken to brake, where their model does not say."""
GROWS_S = 0.2
"""The delay grows by so much from the report before braking to the next."""
RISES = 1.3
"""A robot is on its way again once it goes so many times as fast as when it was slowest."""
FOLLOWS = 0.5
"""A robot follows its forecast where it goes at least this share of what its forecast of the report before said."""
SAME_PLACE_M = 0.03
"""Places that differ by less are one."""

FINDING = np.dtype(
    [
        ("row", np.int64),  # of the reports taken in
        ("kind", np.int64),  # BRAKED, SWERVED or RESUMED
        ("onset_s", np.float64),  # when the robot began to give way; when it was seen to go on
        ("doubt_s", np.float64),  # by how much the onset may be off
        ("onset_place", np.int64),  # of the report in the history from which the robot gave way
        ("forecast_place", np.int64),  # of the forecast in the history that it departed from
        ("speed_mps", np.float64),  # at the onset
        ("lost_s", np.float64),  # by how much the delay had grown when it was noticed
    ],
    align=True,
)
Findings = NDArray[Any]
"""Of `FINDING`."""
BRAKED, SWERVED, RESUMED = range(3)

STATE = np.dtype(
    [
        ("newest", np.int64),  # place of the newest report in the history
        ("reports", np.int64),  # how many were kept, at most KEPT
        ("gives_way", np.bool_),  # since the last finding the robot has not followed its forecast again
        ("armed", np.bool_),  # it has gone faster since, so that it may brake anew
        ("slowest_mps", np.float64),  # since the last finding
        ("noticed_s", np.float64),  # time of the report of the last finding
    ],
    align=True,
)

_STATES, _FINDINGS = (numba.from_dtype(one)[::1] for one in (STATE, FINDING))
_INTS, _FLOATS, _MATRIX = numba.int64[::1], numba.float64[::1], numba.float64[:, ::1]
_TRACKS = numba.float64[:, :, :, ::1]
_STAMPS = numba.types.Array(numba.float64, 1, "C", readonly=True)


@inner
def _delay_s(track: Floats, made_s: float, x: float, y: float, at_s: float) -> tuple[float, float]:
    """How much later than its forecast `track` (AHEAD_S + 1, 3) a robot is at a place, and how far off the way."""
    least_m, delay_s = inf, 0.0
    for leg in range(len(track) - 1):
        from_x, from_y = track[leg, 0], track[leg, 1]
        along_x, along_y = track[leg + 1, 0] - from_x, track[leg + 1, 1] - from_y
        square = along_x * along_x + along_y * along_y
        towards = (x - from_x) * along_x + (y - from_y) * along_y
        share = towards / square if square > 1e-6 else at_s - made_s - leg
        share = min(max(share, 0.0), 1.0)
        off_m = hypot(x - from_x - share * along_x, y - from_y - share * along_y)
        late_s = at_s - (made_s + leg + share)
        if off_m < least_m - SAME_PLACE_M or (off_m < least_m + SAME_PLACE_M and abs(late_s) < abs(delay_s)):
            least_m, delay_s = min(off_m, least_m), late_s
    return delay_s, least_m


@inner
def _expected_m(track: Floats, lasts_s: float) -> float:
    """How far its forecast has a robot go in so long."""
    gone_m = 0.0
    for leg in range(len(track) - 1):
        part = min(max(lasts_s - leg, 0.0), 1.0)
        if part <= 0.0:
            break
        gone_m += part * hypot(track[leg + 1, 0] - track[leg, 0], track[leg + 1, 1] - track[leg, 1])
    return gone_m


@inner
def _before(state: Any, back: int) -> int:
    """The place of the report so many before the newest."""
    return int((state.newest - back) % KEPT)


@inner
def _keep(
    state: Any, t_s: Floats, tracks: Floats, floor: Floats, speed: Floats, follows: Floats, slot: int, row: int,
    event_s: float, told: Floats,
) -> None:  # fmt: skip
    """Put a report, with its forecast, into the history."""
    place = (state.newest + 1) % KEPT
    last = state.newest
    state.newest, state.reports = place, min(state.reports + 1, KEPT)
    t_s[slot, place], floor[slot, place] = event_s, told[row, 0, 3]
    for at in range(AHEAD_S + 1):
        for part in range(3):
            tracks[slot, place, at, part] = told[row, at, part]
    speed[slot, place] = follows[slot, place] = 0.0
    lasted_s = event_s - t_s[slot, last]
    if state.reports < 2 or floor[slot, last] != floor[slot, place] or lasted_s <= 0.0:
        state.reports = 1
        return
    went_m = hypot(told[row, 0, 0] - tracks[slot, last, 0, 0], told[row, 0, 1] - tracks[slot, last, 0, 1])
    expected_m = _expected_m(tracks[slot, last], lasted_s)
    speed[slot, place] = went_m / lasted_s
    follows[slot, place] = went_m / expected_m if expected_m > 0.2 else (1.0 if went_m > 0.2 else 0.0)


@inner
def _forecast_before(state: Any, t_s: Floats, slot: int, back: int) -> int:
    """How many reports before the newest the forecast is that one `back` before it is compared with; -1 for none."""
    at_s = t_s[slot, _before(state, back)]
    for further in range(back + 1, state.reports):
        gap_s = at_s - t_s[slot, _before(state, further)]
        if gap_s > EARLIEST_S:
            return -1
        if gap_s >= EARLIER_S - 0.15:
            return further
    return -1


@inner
def _slows(state: Any, speed: Floats, slot: int, back: int, top_mps: float) -> bool:
    """Whether a robot brakes after the report `back` before the newest: at once, and by much until now."""
    if speed[slot, _before(state, back - 1)] >= SLOWS * top_mps:
        return False
    least_mps = inf
    for later in range(back):
        least_mps = min(least_mps, speed[slot, _before(state, later)])
    return least_mps < BRAKES * top_mps


@inner
def _goes(state: Any, speed: Floats, follows: Floats, slot: int, back: int) -> bool:
    """Whether a robot was getting on at the report `back` before the newest, rather than creeping around something."""
    here, last = _before(state, back), _before(state, back + 1)
    speeds_up = speed[slot, here] >= 1.15 * speed[slot, last] and speed[slot, here] > 1.5 * MOVES_MPS
    return bool(follows[slot, here] >= FOLLOWS or follows[slot, last] >= FOLLOWS or speeds_up)


@inner
def _begun_s(top_mps: float, lost_s: float, now_s: float) -> float:
    """When a robot began to brake that had gone so fast and has lost so much progress since."""
    return now_s - sqrt(2.0 * top_mps * max(lost_s, 0.0) / BRAKES_MPS2)


@inner
def _find_braking(
    state: Any,
    t_s: Floats,
    tracks: Floats,
    speed: Floats,
    follows: Floats,
    slot: int,
    usual_m: Floats,
    finding: Any,
) -> bool:
    """Set what is found where the newest report shows that a robot has braked, and has lost more of its way than robots
    of its kind usually are `usual_m` (AHEAD_S,) off their forecasts so many whole seconds ahead."""
    now, now_s = tracks[slot, state.newest, 0], t_s[slot, state.newest]
    for back in range(1, min(state.reports - 1, 7)):
        place = _before(state, back)
        at_s, top_mps = t_s[slot, place], max(speed[slot, place], speed[slot, _before(state, back + 1)])
        if not (now_s - at_s <= WITHIN_S + 0.2 and at_s > state.noticed_s and top_mps > MOVES_MPS):
            continue
        if not (_goes(state, speed, follows, slot, back) and _slows(state, speed, slot, back, top_mps)):
            continue
        further = _forecast_before(state, t_s, slot, back)
        if further < 0:
            continue
        made = _before(state, further)
        track, made_s, following = tracks[slot, made], t_s[slot, made], _before(state, back - 1)
        then_s, _ = _delay_s(track, made_s, tracks[slot, place, 0, 0], tracks[slot, place, 0, 1], at_s)
        next_s, _ = _delay_s(
            track, made_s, tracks[slot, following, 0, 0], tracks[slot, following, 0, 1], t_s[slot, following]
        )
        late_s, _ = _delay_s(track, made_s, now[0], now[1], now_s)
        lost_s, usually_m = late_s - then_s, usual_m[min(int(now_s - made_s), AHEAD_S - 1)]
        if lost_s >= LOST_S and next_s - then_s >= GROWS_S and lost_s * top_mps >= usually_m:
            before = _before(state, back + 1)
            was_s, _ = _delay_s(
                track, made_s, tracks[slot, before, 0, 0], tracks[slot, before, 0, 1], t_s[slot, before]
            )
            begun_s = _begun_s(top_mps, next_s - min(was_s, then_s), t_s[slot, following])
            finding.kind, finding.onset_s = BRAKED, max(begun_s, t_s[slot, before])
            finding.doubt_s = t_s[slot, following] - at_s
            finding.onset_place, finding.forecast_place = place, made
            finding.speed_mps, finding.lost_s = top_mps, lost_s
            return True
    return False


@inner
def _find_sparse_braking(state: Any, t_s: Floats, tracks: Floats, speed: Floats, slot: int, finding: Any) -> bool:
    """The same for a robot that reports seldom: by its delay against the forecast of the report before."""
    place = _before(state, 1)
    at_s, now_s, track = t_s[slot, place], t_s[slot, state.newest], tracks[slot, place]
    lasted_s = now_s - at_s
    told_mps = _expected_m(track, 2.0) / 2.0
    if lasted_s > AHEAD_S or told_mps <= MOVES_MPS or speed[slot, state.newest] >= BRAKES * told_mps:
        return False
    late_s, _ = _delay_s(track, at_s, tracks[slot, state.newest, 0, 0], tracks[slot, state.newest, 0, 1], now_s)
    if late_s < LOST_S:
        return False
    finding.kind, finding.doubt_s = BRAKED, lasted_s / 2
    finding.onset_s = max(at_s, now_s - late_s - told_mps / 2)
    finding.onset_place = finding.forecast_place = place
    finding.speed_mps, finding.lost_s = told_mps, late_s
    return True


@inner
def _find_swerving(
    state: Any,
    t_s: Floats,
    tracks: Floats,
    speed: Floats,
    slot: int,
    half_width_m: float,
    usual_m: Floats,
    finding: Any,
) -> bool:
    """Set what is found where the newest report shows that a robot has left its way: further than half its width, and
    than robots of its kind usually are `usual_m` (AHEAD_S,) off their forecasts so many whole seconds ahead."""
    if min(speed[slot, state.newest], speed[slot, _before(state, 1)]) < MOVES_MPS:
        return False
    further = _forecast_before(state, t_s, slot, 1)
    if further < 0:
        return False
    made, last = _before(state, further), _before(state, 1)
    track, made_s, now_s = tracks[slot, made], t_s[slot, made], t_s[slot, state.newest]
    bound_m = max(half_width_m, usual_m[min(int(now_s - made_s), AHEAD_S - 1)])
    _, was_off_m = _delay_s(track, made_s, tracks[slot, last, 0, 0], tracks[slot, last, 0, 1], t_s[slot, last])
    _, off_m = _delay_s(track, made_s, tracks[slot, state.newest, 0, 0], tracks[slot, state.newest, 0, 1], now_s)
    if not (off_m > bound_m >= was_off_m and t_s[slot, last] > state.noticed_s):
        return False
    finding.kind, finding.onset_s, finding.doubt_s = SWERVED, t_s[slot, last], now_s - t_s[slot, last]
    finding.onset_place, finding.forecast_place = last, made
    finding.speed_mps, finding.lost_s = speed[slot, last], 0.0
    return True


@inner
def _has_resumed(state: Any, speed: Floats, follows: Floats, slot: int) -> bool:
    """Whether a robot follows its forecast again, at the newest report."""
    return bool(speed[slot, state.newest] > MOVES_MPS and follows[slot, state.newest] >= FOLLOWS)


@inner
def _notice(state: Any, now_mps: float, finding: Any) -> None:
    """Remember a finding."""
    state.gives_way, state.armed = True, False
    state.slowest_mps, state.noticed_s = now_mps, finding.onset_s + finding.doubt_s


@kernel(
    _FINDINGS(
        _STATES,
        _MATRIX,
        _TRACKS,
        *[_MATRIX] * 3,
        _INTS,
        _STAMPS,
        numba.float64[:, :, ::1],
        _FLOATS,
        numba.boolean[::1],
        _MATRIX,
    )
)
def follow(
    states: NDArray[Any],
    t_s: Floats,
    tracks: Floats,
    floor: Floats,
    speed: Floats,
    follows: Floats,
    slots: Ints,
    event_s: Floats,
    told: Floats,
    half_width_m: Floats,
    explained: Bools,
    usual_m: Floats,
) -> Findings:
    """Take reports of robots `slots` (n,), all different, at `event_s` (n,) into the history, with the tracks that they
    forecast, `told` (n, k, 4): x_m, y_m, yaw_rad and floor at whole seconds from the report on; what they show.

    `states` are (slots,); `t_s`, `floor`, `speed` and `follows` (slots, KEPT): when each kept report was true, on which
    floor, how fast the robot had come there, and what share of its forecast way it had come; `tracks` (slots, KEPT,
    AHEAD_S + 1, 3). `half_width_m` (n,) of the envelopes; `explained` (n,) whether a robot says why it stands;
    `usual_m` (n, AHEAD_S) how far off the way its kind usually is.
    """
    findings, found = np.empty(2 * len(slots), FINDING), 0
    for row in range(len(slots)):
        slot, state = slots[row], states[slots[row]]
        if state.reports > 0 and not event_s[row] - t_s[slot, state.newest] >= SPACED_S:
            continue
        if not np.isfinite(told[row, :, :3].sum()):
            continue
        _keep(state, t_s, tracks, floor, speed, follows, slot, row, event_s[row], told)
        if state.reports < 2:
            state.gives_way, state.armed, state.noticed_s = False, True, -inf
            continue
        now_mps, now_s = speed[slot, state.newest], event_s[row]
        if state.gives_way and _has_resumed(state, speed, follows, slot):
            state.gives_way, state.armed = False, True
            findings[found].row, findings[found].kind, findings[found].onset_s = row, RESUMED, now_s
            found += 1
        if not state.armed:
            state.armed = now_mps > MOVES_MPS and now_mps > RISES * state.slowest_mps
            state.slowest_mps = min(state.slowest_mps, now_mps)
        if explained[row]:
            state.noticed_s = now_s
            continue
        if not state.armed:
            continue
        finding = findings[found]
        finding.row = row
        if now_s - t_s[slot, _before(state, 1)] > SPARSE_S:
            is_found = _find_sparse_braking(state, t_s, tracks, speed, slot, finding)
        else:
            is_found = _find_braking(state, t_s, tracks, speed, follows, slot, usual_m[row], finding) or _find_swerving(
                state, t_s, tracks, speed, slot, half_width_m[row], usual_m[row], finding
            )
        if is_found:
            _notice(state, now_mps, finding)
            found += 1
    return findings[:found].copy()
