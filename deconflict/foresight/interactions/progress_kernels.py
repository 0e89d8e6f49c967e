"""How robots progress along their forecast ways, and when one of them gives way.

A robot's history holds its newest reports, each with its forecast. The delay of a report against an earlier forecast is
how much later the robot is at its place than that forecast said. A robot brakes if its delay grows by a second within
five, and it becomes much slower than before. It swerves if it leaves the forecast way by more than half its width.

The file is long because its functions are compiled: they read the history number by number, and take its columns, by
slot, one by one. Most helpers are called once for each kept report of each robot.
"""

from math import hypot, inf, sqrt
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.foresight.motion_assumptions import BRAKES_MPS2, JOINED_S, LOST_S, MOVES_MPS, SPACED_S
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import BOOLS, CUBE, CUBES, FLOATS, INTS, MATRIX, READ_FLOATS, inner, kernel

KEPT = 12
"""Number of reports in the history of a robot."""
AHEAD_S = 10
"""The forecast of a kept report is kept for this many whole seconds; sample 0 is the report itself."""
EARLIER_S, EARLIEST_S = 2.0, 4.0
"""Minimum and maximum age of the forecast with which a report is compared. The newest such forecast is used."""
WITHIN_S = 5.0
"""A robot gives way if it loses `LOST_S` within this time."""
SLOWS, BRAKES = 0.85, 0.6
"""A braking robot falls below these shares of its speed: at its next report, and at any report until it is noticed."""
GROWS_S = 0.2
"""From the last report before braking to the next, the delay grows by at least this."""
RISES = 1.3
"""A robot is on its way again once it is this many times as fast as at its slowest."""
FOLLOWS = 0.5
"""A robot follows its forecast if it goes at least this share of the distance that the forecast of the last report
said."""
SAME_PLACE_M = 0.03
"""Places that differ by less count as the same."""

FINDING = np.dtype(
    [
        ("row", np.int64),  # of the reports that `add_reports` was given
        ("kind", np.int64),  # BRAKED, SWERVED or RESUMED
        ("onset_s", np.float64),  # when the robot began to give way; if RESUMED, when it was seen to drive on
        ("doubt_s", np.float64),  # uncertainty of the onset
        ("onset_index", np.int64),  # place in the history of the last report before the onset
        ("forecast_index", np.int64),  # place in the history of the forecast from which it departed
        ("speed_mps", np.float64),  # at the onset
        ("lost_s", np.float64),  # how much the delay had grown when it was noticed
    ],
    align=True,
)
Findings = NDArray[Any]
"""Of `FINDING`."""
BRAKED, SWERVED, RESUMED = range(3)

STATE = np.dtype(
    [
        ("newest", np.int64),  # place of the newest report in the history
        ("reports", np.int64),  # number of kept reports, at most KEPT
        ("gives_way", np.bool_),  # the robot has not followed its forecast again since the last finding
        ("armed", np.bool_),  # it has become faster since then, so that braking again would be a new finding
        ("slowest_mps", np.float64),  # lowest speed since the last finding
        ("noticed_s", np.float64),  # time of the report of the last finding
    ],
    align=True,
)

_STATES, _FINDINGS = (numba.from_dtype(dtype)[::1] for dtype in (STATE, FINDING))


@inner
def _delay_s(t_s: Floats, tracks: Floats, slot: int, made: int, place: int) -> tuple[float, float]:
    """How much later a robot is where it was at report `place` of its history than by the forecast of report `made`,
    and its distance from the way."""
    track, made_s = tracks[slot, made], t_s[slot, made]
    x, y, at_s = tracks[slot, place, 0, 0], tracks[slot, place, 0, 1], t_s[slot, place]
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
    """How far a robot goes in `lasts_s` by its forecast."""
    gone_m = 0.0
    for leg in range(len(track) - 1):
        part = min(max(lasts_s - leg, 0.0), 1.0)
        if part <= 0.0:
            break
        gone_m += part * hypot(track[leg + 1, 0] - track[leg, 0], track[leg + 1, 1] - track[leg, 1])
    return gone_m


@inner
def _before(state: Any, back: int) -> int:
    """The place in the history of the report `back` before the newest."""
    return int((state.newest - back) % KEPT)


@inner
def _store_report(
    state: Any, t_s: Floats, tracks: Floats, floor: Floats, speed: Floats, follows: Floats, slot: int, row: int,
    event_s: float, reported: Floats,
) -> None:  # fmt: skip
    """Put report `row`, with its forecast in `reported`, into the history."""
    place = (state.newest + 1) % KEPT
    last = state.newest
    state.newest, state.reports = place, min(state.reports + 1, KEPT)
    t_s[slot, place], floor[slot, place] = event_s, reported[row, 0, 3]
    for at in range(AHEAD_S + 1):
        for part in range(3):
            tracks[slot, place, at, part] = reported[row, at, part]
    speed[slot, place] = follows[slot, place] = 0.0
    lasted_s = event_s - t_s[slot, last]
    if state.reports < 2 or floor[slot, last] != floor[slot, place] or lasted_s <= 0.0:
        state.reports = 1
        return
    went_m = hypot(reported[row, 0, 0] - tracks[slot, last, 0, 0], reported[row, 0, 1] - tracks[slot, last, 0, 1])
    expected_m = _expected_m(tracks[slot, last], lasted_s)
    speed[slot, place] = went_m / lasted_s
    follows[slot, place] = went_m / expected_m if expected_m > 0.2 else (1.0 if went_m > 0.2 else 0.0)


@inner
def _forecast_before(state: Any, t_s: Floats, slot: int, back: int) -> int:
    """The forecast with which the report `back` before the newest is compared, as a number of reports before the
    newest; -1 if there is none."""
    at_s = t_s[slot, _before(state, back)]
    for further in range(back + 1, state.reports):
        gap_s = at_s - t_s[slot, _before(state, further)]
        if gap_s > EARLIEST_S:
            return -1
        if gap_s >= EARLIER_S - 0.15:
            return further
    return -1


@inner
def _brakes_after(state: Any, speed: Floats, slot: int, back: int, top_mps: float) -> bool:
    """Whether a robot brakes after the report `back` before the newest: at the next report, and strongly until now."""
    if speed[slot, _before(state, back - 1)] >= SLOWS * top_mps:
        return False
    least_mps = inf
    for later in range(back):
        least_mps = min(least_mps, speed[slot, _before(state, later)])
    return least_mps < BRAKES * top_mps


@inner
def _made_progress(state: Any, speed: Floats, follows: Floats, slot: int, back: int) -> bool:
    """Whether a robot made progress at the report `back` before the newest, and did not creep around something."""
    here, last = _before(state, back), _before(state, back + 1)
    speeds_up = speed[slot, here] >= 1.15 * speed[slot, last] and speed[slot, here] > 1.5 * MOVES_MPS
    return bool(follows[slot, here] >= FOLLOWS or follows[slot, last] >= FOLLOWS or speeds_up)


@inner
def _begun_s(top_mps: float, lost_s: float, now_s: float) -> float:
    """When a robot began to brake that drove at `top_mps` and has lost `lost_s` of progress since."""
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
    """Find whether the newest report shows that a robot has braked, and fill in `finding`. The way that it has lost
    must be more than the usual errors `usual_m` (AHEAD_S,) of its kind, by whole seconds ahead."""
    now_s = t_s[slot, state.newest]
    for back in range(1, min(state.reports - 1, 7)):
        place = _before(state, back)
        at_s, top_mps = t_s[slot, place], max(speed[slot, place], speed[slot, _before(state, back + 1)])
        if not (now_s - at_s <= WITHIN_S + 0.2 and at_s > state.noticed_s and top_mps > MOVES_MPS):
            continue
        if not (_made_progress(state, speed, follows, slot, back) and _brakes_after(state, speed, slot, back, top_mps)):
            continue
        further = _forecast_before(state, t_s, slot, back)
        if further < 0:
            continue
        made, following = _before(state, further), _before(state, back - 1)
        then_s, _ = _delay_s(t_s, tracks, slot, made, place)
        next_s, _ = _delay_s(t_s, tracks, slot, made, following)
        late_s, _ = _delay_s(t_s, tracks, slot, made, state.newest)
        lost_s, usually_m = late_s - then_s, usual_m[min(int(now_s - t_s[slot, made]), AHEAD_S - 1)]
        if lost_s >= LOST_S and next_s - then_s >= GROWS_S and lost_s * top_mps >= usually_m:
            before = _before(state, back + 1)
            was_s, _ = _delay_s(t_s, tracks, slot, made, before)
            begun_s = _begun_s(top_mps, next_s - min(was_s, then_s), t_s[slot, following])
            finding.kind, finding.onset_s = BRAKED, max(begun_s, t_s[slot, before])
            finding.doubt_s = t_s[slot, following] - at_s
            finding.onset_index, finding.forecast_index = place, made
            finding.speed_mps, finding.lost_s = top_mps, lost_s
            return True
    return False


@inner
def _find_sparse_braking(state: Any, t_s: Floats, tracks: Floats, speed: Floats, slot: int, finding: Any) -> bool:
    """The same for a robot that reports rarely, by its delay against the forecast of its last report."""
    place = _before(state, 1)
    at_s, now_s = t_s[slot, place], t_s[slot, state.newest]
    lasted_s = now_s - at_s
    forecast_mps = _expected_m(tracks[slot, place], 2.0) / 2.0
    if lasted_s > AHEAD_S or forecast_mps <= MOVES_MPS or speed[slot, state.newest] >= BRAKES * forecast_mps:
        return False
    late_s, _ = _delay_s(t_s, tracks, slot, place, state.newest)
    if late_s < LOST_S:
        return False
    finding.kind, finding.doubt_s = BRAKED, lasted_s / 2
    finding.onset_s = max(at_s, now_s - late_s - forecast_mps / 2)
    finding.onset_index = finding.forecast_index = place
    finding.speed_mps, finding.lost_s = forecast_mps, late_s
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
    """Find whether the newest report shows that a robot has left its way, and fill in `finding`. It must be off by more
    than half its width, and by more than the usual errors `usual_m` (AHEAD_S,) of its kind, by whole seconds ahead."""
    if min(speed[slot, state.newest], speed[slot, _before(state, 1)]) < MOVES_MPS:
        return False
    further = _forecast_before(state, t_s, slot, 1)
    if further < 0:
        return False
    made, last, now_s = _before(state, further), _before(state, 1), t_s[slot, state.newest]
    bound_m = max(half_width_m, usual_m[min(int(now_s - t_s[slot, made]), AHEAD_S - 1)])
    _, was_off_m = _delay_s(t_s, tracks, slot, made, last)
    _, off_m = _delay_s(t_s, tracks, slot, made, state.newest)
    if not (off_m > bound_m >= was_off_m and t_s[slot, last] > state.noticed_s):
        return False
    finding.kind, finding.onset_s, finding.doubt_s = SWERVED, t_s[slot, last], now_s - t_s[slot, last]
    finding.onset_index, finding.forecast_index = last, made
    finding.speed_mps, finding.lost_s = speed[slot, last], 0.0
    return True


@inner
def _has_resumed(state: Any, speed: Floats, follows: Floats, slot: int) -> bool:
    """Whether a robot follows its forecast again at the newest report."""
    return bool(speed[slot, state.newest] > MOVES_MPS and follows[slot, state.newest] >= FOLLOWS)


@inner
def _note_finding(state: Any, now_mps: float, finding: Any) -> None:
    """Update the state of a robot after a finding."""
    state.gives_way, state.armed = True, False
    state.slowest_mps, state.noticed_s = now_mps, finding.onset_s + finding.doubt_s


@kernel(_FINDINGS(_STATES, MATRIX, CUBES, *[MATRIX] * 3, INTS, READ_FLOATS, CUBE, FLOATS, BOOLS, MATRIX))
def add_reports(
    states: NDArray[Any],
    t_s: Floats,
    tracks: Floats,
    floor: Floats,
    speed: Floats,
    follows: Floats,
    slots: Ints,
    event_s: Floats,
    reported: Floats,
    half_width_m: Floats,
    explained: Bools,
    usual_m: Floats,
) -> Findings:
    """Add reports of robots `slots` (n,), all different, to the history, and return what they show.

    The reports are of the times `event_s` (n,), with the forecast tracks `reported` (n, k, 4): x_m, y_m, yaw_rad and
    floor, at whole seconds from the report on. `half_width_m` (n,) are of the envelopes. `explained` (n,) is whether a
    robot says why it stands. `usual_m` (n, AHEAD_S) are the usual errors of its kind.

    The history is `states` (slots,), and of each kept report (slots, KEPT): its time `t_s`, its `floor`, the `speed` at
    which the robot had come there, and `follows`, the share of its forecast way that it had come; and its `tracks`
    (slots, KEPT, AHEAD_S + 1, 3).
    """
    findings, found = np.empty(2 * len(slots), FINDING), 0
    for row in range(len(slots)):
        slot, state = slots[row], states[slots[row]]
        if state.reports > 0 and not event_s[row] - t_s[slot, state.newest] >= SPACED_S:
            continue
        if not np.isfinite(reported[row, :, :3].sum()):
            continue
        _store_report(state, t_s, tracks, floor, speed, follows, slot, row, event_s[row], reported)
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
        if now_s - t_s[slot, _before(state, 1)] > JOINED_S:
            is_found = _find_sparse_braking(state, t_s, tracks, speed, slot, finding)
        else:
            is_found = _find_braking(state, t_s, tracks, speed, follows, slot, usual_m[row], finding) or _find_swerving(
                state, t_s, tracks, speed, slot, half_width_m[row], usual_m[row], finding
            )
        if is_found:
            _note_finding(state, now_mps, finding)
            found += 1
    return findings[:found].copy()
