"""What a pass makes of the pairs under watch, in kernels: it notes what changes nothing of what is told, and finds the
few pairs of which something may have to be told."""

from math import hypot, inf
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.geometry.encounter import ENCOUNTER, Encounters
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import inner, kernel

TOLD = np.dtype(
    [(name, np.bool_) for name in ("stands", "begun")]
    + [(name, np.int64) for name in ("level", "kind", "floor")]
    + [(name, np.float64) for name in ("updated_s", "probability", "contact_s", "separation_m", "x_m", "y_m")],
    align=True,
)
"""Whether a pair has an open advisory, and of what has begun; its places among `SEVERITIES` and `CLASSES`, and the
floor, -1 where it is not known; when it was told; and how likely it says that the two meet, when, how near, and
where."""

ROW = np.dtype(
    [
        ("there", np.bool_),  # a pair has the row
        ("inside", np.bool_),  # within the clearance, or not yet drawn apart from it
        ("met", np.bool_),  # it came within the clearance while the advisory stood
        ("sure", np.bool_),  # what was weighed last was likely enough for its severity
        ("predicted", np.bool_),  # something is predicted in this pass
        ("looks", np.int64),  # in which of the last looks it was alerting, the newest in the lowest bit
        ("predicted_s", np.float64),  # when something was last predicted of an advisory's pair
        ("contact_s", np.float64),  # time of the prediction that was weighed last
        ("separation_m", np.float64),  # its separation
        ("until_s", np.float64),  # when time alone may make it worth a revision
        ("still_since_s", np.float64),  # since when both stand, or one gives way to the other; inf where neither
    ],
    align=True,
)
"""A pair under watch."""


BOUNDS = np.dtype(
    [
        (name, np.float64)
        for name in ("clearance_m", "apart_m", "touching_m", "raises", "held", "sure", "evident", "left")
    ]
    + [(name, np.float64) for name in ("urgent_s", "clear_after_s", "fades_s", "warning_s", "critical_s", "slack_s")]
    + [(name, np.float64) for name in ("gap_s", "likelier", "moved_s", "deeper_m")],
    align=True,
)
"""What decides. Robots further apart than `apart_m` have drawn apart; a pair that begins nearer than `touching_m` is
touching already. A prediction less likely than `raises` raises no advisory; one less likely than `sure` only where
envelopes come within the clearance, and less severe a one; one more likely than `evident`, or nearer than `urgent_s`,
raises one at its first look; one less likely than `held` lets none stand, and is told of after `fades_s`, also within
the clearance where it is less likely than `left` that both robots are there. Of one advisory there is a revision in
`gap_s`, unless the severity rises. Changes of the probability, the time and the separation by no more than the last
three are surely worth none."""


NOTED, NEW, OVER, RAISES, UNLIKELY, STILL, NEWS, AS_TOLD, LIKELIHOOD = range(-1, 8)
"""Why a pass looks at a prediction: not at all; the pair is under watch from now on, or no more; its advisory is to be
raised; was long too unlikely to stand; ends, as both have stood or one has given way for a while; may tell something
else; tells the same, unless the two meet otherwise; tells nothing new but how likely it is."""
_TOLD, _ROW, _BOUNDS = (numba.from_dtype(one) for one in (TOLD, ROW, BOUNDS))
_INTS, _FLOATS, _BOOLS, _REAL = numba.int64[::1], numba.float64[::1], numba.boolean[::1], numba.float64


@inner
def _level(time_s: float, shallow: bool, warning_s: float, critical_s: float) -> int:
    """As `telling.severity_of` of a conflict that was not told yet."""
    return max((time_s <= warning_s) + (time_s <= critical_s) - shallow, 0)


@inner
def _until_s(contact_s: float, now_s: float, warning_s: float, critical_s: float, slack_s: float) -> float:
    """As `telling.severity_until_s`."""
    until_s = inf
    for bound_s in (warning_s, critical_s):
        for grown_s in (slack_s, 0.0):
            at_s = contact_s - bound_s - grown_s
            if at_s > now_s:
                until_s = min(until_s, at_s)
    return until_s


@inner
def _begin(rows: NDArray[Any], first: int) -> int:
    """Take a pair under watch in the first free row from `first` on."""
    while rows[first].there:
        first += 1
    row = rows[first]
    row.there, row.inside, row.met, row.looks = True, False, False, 0
    row.predicted_s, row.until_s, row.still_since_s = -inf, -inf, inf
    return first


@inner
def _is_confirmed(looks: int, wanted_looks: int) -> bool:
    while looks and wanted_looks > 0:
        looks &= looks - 1
        wanted_looks -= 1
    return wanted_looks <= 0


@inner
def _is_likely(contact_s: float, separation_m: float, deciding: float, now_s: float, bounds: Any) -> bool:
    """Whether an encounter is yet to come that is worth an advisory."""
    wanted = max(bounds.raises, bounds.sure) if separation_m > bounds.clearance_m else bounds.raises
    return deciding >= wanted and contact_s > now_s


@inner
def _look(
    row: Any,
    fresh: bool,
    start_m: float,
    separation_m: float,
    likely: bool,
    deciding: float,
    still: bool,
    remembered: int,
    bounds: Any,
) -> bool:
    """Note that something is predicted of a pair that is so far apart now; whether it is coming together, rather than
    beginning together, by something new."""
    row.predicted = True
    if start_m <= bounds.clearance_m:
        row.inside = row.met = True
    elif start_m > bounds.apart_m:
        row.inside = False
    about_to_touch = separation_m == 0 and start_m > bounds.touching_m and deciding >= bounds.raises
    alerting = fresh and not still and (about_to_touch if row.inside else likely)
    if fresh:
        row.looks, row.until_s = (row.looks << 1 | alerting) & remembered, -inf
    return alerting


@inner
def _of_untold(
    row: Any,
    is_new: bool,
    alerting: bool,
    contact_s: float,
    deciding: float,
    now_s: float,
    wanted_looks: int,
    bounds: Any,
) -> int:
    """What there is to do for a pair without an advisory."""
    at_once = deciding > bounds.evident or contact_s - now_s <= bounds.urgent_s
    if alerting and (at_once or _is_confirmed(row.looks, wanted_looks)):
        row.met, row.predicted_s, row.still_since_s = False, now_s, inf
        return RAISES
    if is_new:
        return NEW
    if row.inside or row.looks:
        return NOTED
    row.there = False
    return OVER


@inner
def _likelihood(before: Any, probability: float, now_s: float, bounds: Any) -> int:
    """What there is to do where nothing but the probability may be told of."""
    changed = abs(probability - before.probability) > bounds.likelier
    return LIKELIHOOD if changed and now_s >= before.updated_s + bounds.gap_s else NOTED


@inner
def _of_unlikely(row: Any, before: Any, probability: float, now_s: float, bounds: Any) -> int:
    """What there is to do for a pair with an advisory that is not likely enough to stand."""
    unlikely_s = now_s - row.predicted_s
    if unlikely_s >= bounds.clear_after_s:
        return UNLIKELY
    return _likelihood(before, probability, now_s, bounds) if unlikely_s >= bounds.fades_s else NOTED


@inner
def _of_told(
    row: Any,
    before: Any,
    fresh: bool,
    contact_s: float,
    separation_m: float,
    probability: float,
    now_s: float,
    bounds: Any,
) -> int:
    """What there is to do for a pair with an advisory that is likely enough to stand."""
    row.predicted_s = now_s
    is_sure, as_likely = probability >= bounds.sure, abs(probability - before.probability) <= bounds.likelier
    is_weighed = contact_s == row.contact_s and separation_m == row.separation_m and is_sure == row.sure
    if not fresh and is_weighed and as_likely and now_s < row.until_s:
        return NOTED
    if before.begun and contact_s <= now_s:
        return _likelihood(before, probability, now_s, bounds)
    time_s, next_s = contact_s - now_s, before.updated_s + bounds.gap_s
    shallow = separation_m > bounds.clearance_m / 2 or not is_sure
    least = _level(time_s, shallow, bounds.warning_s, bounds.critical_s)
    most = _level(time_s, shallow, bounds.warning_s + bounds.slack_s, bounds.critical_s + bounds.slack_s)
    soon = now_s < next_s and least <= before.level
    as_told = least <= before.level <= most and as_likely and abs(contact_s - before.contact_s) <= bounds.moved_s
    as_told = as_told and abs(separation_m - before.separation_m) <= bounds.deeper_m
    if soon or as_told:
        row.contact_s, row.separation_m, row.sure = contact_s, separation_m, is_sure
        until_s = _until_s(contact_s, now_s, bounds.warning_s, bounds.critical_s, bounds.slack_s)
        row.until_s = min(until_s, next_s) if soon else until_s
    if soon:
        return NOTED
    return AS_TOLD if as_told else NEWS


@inner
def _has_been_still(row: Any, still: bool, now_s: float, clear_after_s: float) -> bool:
    """Whether both have stood, or one has given way to the other, for so long."""
    if not still:
        row.still_since_s = inf
    elif row.still_since_s == inf:
        row.still_since_s = now_s
    return bool(now_s - row.still_since_s >= clear_after_s)


@inner
def _missing(rows: NDArray[Any], told: NDArray[Any], now_s: float, clear_after_s: float) -> tuple[Ints, Bools]:
    """Pairs of which nothing is predicted, and whether nothing may be cleared of each."""
    missed, rests, n = np.empty(len(rows), np.int64), np.empty(len(rows), np.bool_), 0
    for place in range(len(rows)):
        row = rows[place]
        if row.there and not row.predicted:
            missed[n], rests[n] = place, not told[place].stands or now_s - row.predicted_s < clear_after_s
            n += 1
        row.predicted = False
    return missed[:n].copy(), rests[:n].copy()


@kernel(
    numba.types.Tuple((*[_INTS] * 3, _BOOLS))(  # type: ignore[no-untyped-call]
        _ROW[::1],
        _TOLD[::1],
        _INTS,
        *[_FLOATS] * 3,
        _BOOLS,
        *[_FLOATS] * 2,
        _BOOLS,
        _FLOATS,
        *[numba.int64] * 2,
        _REAL,
        _BOUNDS[::1],
    )
)
def stirring(
    rows: NDArray[Any],
    told: NDArray[Any],
    at: Ints,
    contact_s: Floats,
    separation_m: Floats,
    start_m: Floats,
    fresh: Bools,
    probability: Floats,
    deciding: Floats,
    still: Bools,
    there: Floats,
    remembered: int,
    wanted_looks: int,
    now_s: float,
    bounds: NDArray[Any],
) -> tuple[Ints, Ints, Ints, Bools]:
    """Which predictions to look at, and why; of which pairs nothing is predicted, and of which of them nothing
    may be cleared.

    `at` (p,) are the rows of the pairs that are predicted, -1 for those that are not under watch; new ones are given
    free rows, of which there must be enough. `remembered` has a bit for each look that counts.
    """
    bound = bounds[0]
    some, why, n, free = np.empty(len(at), np.int64), np.empty(len(at), np.int64), 0, 0
    for one in range(len(at)):
        likely, is_new = _is_likely(contact_s[one], separation_m[one], deciding[one], now_s, bound), at[one] < 0
        if is_new:
            if not fresh[one] or not (likely or start_m[one] <= bound.clearance_m):
                continue
            at[one] = free = _begin(rows, free)
        row, before = rows[at[one]], told[at[one]]
        alerting = _look(
            row, fresh[one], start_m[one], separation_m[one], likely, deciding[one], still[one], remembered, bound
        )
        if not before.stands:
            reason = _of_untold(row, is_new, alerting, contact_s[one], deciding[one], now_s, wanted_looks, bound)
        elif _has_been_still(row, still[one], now_s, bound.clear_after_s):
            reason = STILL
        elif deciding[one] < bound.held and not (row.inside and there[one] >= bound.left):
            reason = _of_unlikely(row, before, probability[one], now_s, bound)
        else:
            reason = _of_told(
                row, before, fresh[one], contact_s[one], separation_m[one], probability[one], now_s, bound
            )
        if reason != NOTED:
            some[n], why[n], n = one, reason, n + 1
    missed, rests = _missing(rows, told, now_s, bound.clear_after_s)
    return some[:n].copy(), why[:n].copy(), missed, rests


@kernel(_BOOLS(_TOLD[::1], _INTS, numba.from_dtype(ENCOUNTER)[::1], _REAL))
def elsewhere(told: NDArray[Any], at: Ints, met: Encounters, moved_m: float) -> Bools:
    """Whether the advisories of rows `at` (n,) may say of two another class, floor or place than that they meet so
    (n,); also where they do not tell the floor, or the place is not known."""
    differs = np.empty(len(at), np.bool_)
    for one in range(len(at)):
        before, now = told[at[one]], met[one]
        near = hypot(now.x - before.x_m, now.y - before.y_m) <= moved_m
        differs[one] = not near or now.kind != before.kind or now.floor != before.floor or before.floor < 0
    return differs
