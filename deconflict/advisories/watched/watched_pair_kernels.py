"""The decisions on conflict advisories: what the predictions of a pass change, for all watched pairs at once.

`examine_pairs` updates the row of each watched pair and decides which of the codes below holds:

1. A pair is watched from its first fresh prediction that is likely or begins within the clearance.
2. Without an open advisory: `RAISE` once enough looks were alerting, `FORGET` if nothing is left to remember.
3. With an open advisory, the first that holds: `CLEAR_STILL` if both have been still for a while; `MAY_CLEAR` or
   `UPDATE_PROBABILITY` if the conflict is too unlikely, or not predicted; `UPDATE`, `UPDATE_IF_MOVED` or
   `UPDATE_PROBABILITY` if the prediction differs from the advisory.

`conflict_lifecycle` carries the codes out. It adds what only the scene knows: where and how the two meet, whether they
are there, and whether they have drawn apart.

The fields of a row stand in `watched_pair_rows`. `examine_pairs` is long because it is one loop over many columns.
"""

from math import hypot, inf
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.advisories.revision_rules import (
    DEEPER_M,
    LIKELIER,
    MOVED_S,
    ROUNDED,
    UPDATE_GAP_S,
    is_likelier,
    published_probability,
)
from deconflict.advisories.severity import FALLS_S, SURE, severity_level
from deconflict.advisories.watched.watched_pair_rows import OPEN_ADVISORY, PREDICTED, THRESHOLDS, WATCHED_PAIR
from deconflict.foresight.presence.probably_left import PROBABLY_LEFT
from deconflict.sweep.geometry.encounter import ENCOUNTER, Encounters
from ingest.batch import Bools, Ints
from ingest.kernels import BOOLS, FLOAT, INTS, inner, kernel

NO_CHANGE = -1
"""Nothing to do: the pair is not worth watching, or its advisory stands as it is."""
WATCH = 0
"""The pair is watched from now on."""
FORGET = 1
"""The pair is no longer watched."""
RAISE = 2
"""An advisory is to be raised."""
MAY_CLEAR = 3
"""The conflict was too unlikely for long enough: the advisory clears if the two have drawn apart."""
CLEAR_STILL = 4
"""Both have stood, or one has given way, for long enough: the advisory clears."""
UPDATE = 5
"""The prediction differs from the advisory."""
UPDATE_IF_MOVED = 6
"""The prediction is the same as the advisory, unless the two meet at another place or in another way."""
UPDATE_PROBABILITY = 7
"""Nothing but the probability has changed, and the severity by it."""

SAME, FALLING, CHANGED = 0, 1, 2
"""What becomes of an advisory's severity: it stays; it should fall, but has not for long enough; it changes."""

TOUCHING_M = 0.1
"""A pair that begins nearer than this touches already, as far as forecasts can say."""

_ADVISORIES, _PAIRS, _PREDICTED, _THRESHOLDS = (
    numba.from_dtype(dtype)[::1] for dtype in (OPEN_ADVISORY, WATCHED_PAIR, PREDICTED, THRESHOLDS)
)

_is_likelier, _published_probability = inner(is_likelier), inner(published_probability)
_severity_level = inner(severity_level)


@inner
def _begin_watch(pairs: NDArray[Any], first: int) -> int:
    """Start a pair in the first free row from `first` on, and return that row."""
    while pairs[first].in_use:
        first += 1
    pair = pairs[first]
    pair.in_use, pair.inside, pair.met, pair.looks = True, False, False, 0
    pair.predicted_s, pair.weighed_until_s, pair.still_since_s, pair.lower_since_s = -inf, -inf, inf, inf
    return first


@inner
def _has_enough_looks(looks: int, looks_needed: int) -> bool:
    """Whether at least `looks_needed` bits of `looks` are set."""
    while looks and looks_needed > 0:
        looks &= looks - 1
        looks_needed -= 1
    return looks_needed <= 0


@inner
def _is_likely(predicted: Any, now_s: float, thresholds: Any) -> bool:
    """Whether a conflict that is worth an advisory is still to come."""
    needed = thresholds.raise_probability
    if predicted.separation_m > thresholds.clearance_m:
        needed = max(needed, SURE)
    return predicted.deciding >= needed and predicted.contact_s > now_s


@inner
def _record_look(pair: Any, predicted: Any, is_likely: bool, thresholds: Any) -> bool:
    """Update the row of a predicted pair; return whether this look is alerting.

    A look alerts if a robot has a new forecast and the pair comes together. A pair that begins within the clearance
    alerts only if it is about to touch.
    """
    pair.predicted = True
    if predicted.start_separation_m <= thresholds.clearance_m:
        pair.inside = pair.met = True
    elif predicted.start_separation_m > thresholds.apart_m:
        pair.inside = False
    about_to_touch = (
        predicted.separation_m == 0
        and predicted.start_separation_m > TOUCHING_M
        and predicted.deciding >= thresholds.raise_probability
    )
    is_alerting = predicted.fresh and not predicted.still and (about_to_touch if pair.inside else is_likely)
    if predicted.fresh:
        pair.looks = (pair.looks << 1 | is_alerting) & thresholds.looks_mask
        pair.weighed_until_s = -inf
    return is_alerting


@inner
def _decide_without_advisory(
    pair: Any, predicted: Any, is_new: bool, is_alerting: bool, now_s: float, thresholds: Any
) -> int:
    """The code for a pair that has no open advisory."""
    is_evident = predicted.deciding > thresholds.evident or predicted.contact_s - now_s <= thresholds.urgent_s
    if is_alerting and (is_evident or _has_enough_looks(pair.looks, thresholds.looks_needed)):
        pair.met, pair.predicted_s, pair.still_since_s, pair.lower_since_s = False, now_s, inf, inf
        return RAISE
    if is_new:
        return WATCH
    if pair.inside or pair.looks:
        return NO_CHANGE
    pair.in_use = False
    return FORGET


@inner
def _examine_severity(
    pair: Any, advisory: Any, time_s: float, separation_m: float, probability: float, now_s: float, thresholds: Any
) -> int:
    """What becomes of the severity of an advisory on a conflict `time_s` ahead: `SAME`, `FALLING` or `CHANGED`."""
    if advisory.severity <= _severity_level(time_s, separation_m, probability, thresholds, True):
        pair.lower_since_s = inf
        least = _severity_level(time_s, separation_m, probability, thresholds, False)
        return CHANGED if least > advisory.severity else SAME
    pair.lower_since_s = min(pair.lower_since_s, now_s)
    return CHANGED if now_s - pair.lower_since_s >= FALLS_S else FALLING


@inner
def _decide_probability(pair: Any, advisory: Any, probability: float, now_s: float, thresholds: Any) -> int:
    """The code if nothing but the probability can change, and the severity by it.

    The probability itself must have changed, too: that low ones are published as one value is no news.
    """
    time_s, separation_m = advisory.contact_s - now_s, advisory.separation_m
    severity = _examine_severity(pair, advisory, time_s, separation_m, probability, now_s, thresholds)
    if severity != SAME:
        return UPDATE_PROBABILITY if severity == CHANGED else NO_CHANGE
    has_changed = abs(probability - advisory.probability) > LIKELIER - ROUNDED
    published = _published_probability(probability, thresholds.held_probability)
    has_changed = has_changed and _is_likelier(published, advisory.probability)
    return UPDATE_PROBABILITY if has_changed and now_s >= advisory.updated_s + UPDATE_GAP_S else NO_CHANGE


@inner
def _decide_unlikely(pair: Any, advisory: Any, probability: float, now_s: float, thresholds: Any) -> int:
    """The code for a pair with an open advisory whose conflict is too unlikely for it to stand."""
    if now_s - pair.predicted_s >= thresholds.clear_after_s:
        return MAY_CLEAR
    pair.lower_since_s = min(pair.lower_since_s, pair.predicted_s)
    if now_s - pair.lower_since_s < FALLS_S:
        return NO_CHANGE
    return _decide_probability(pair, advisory, probability, now_s, thresholds)


@inner
def _decide_update(pair: Any, advisory: Any, predicted: Any, now_s: float, thresholds: Any) -> int:
    """The code for a pair with an open advisory whose conflict is likely enough for it to stand."""
    pair.predicted_s = now_s
    contact_s, separation_m, probability = predicted.contact_s, predicted.separation_m, predicted.probability
    if advisory.has_begun and contact_s <= now_s:
        return _decide_probability(pair, advisory, probability, now_s, thresholds)
    severity = _examine_severity(pair, advisory, contact_s - now_s, separation_m, probability, now_s, thresholds)
    if severity != SAME:
        return UPDATE if severity == CHANGED else NO_CHANGE
    is_as_likely = not _is_likelier(probability, advisory.probability)
    is_weighed = contact_s == pair.weighed_contact_s and separation_m == pair.weighed_separation_m
    if not predicted.fresh and is_weighed and is_as_likely and now_s < pair.weighed_until_s:
        return NO_CHANGE
    next_revision_s = advisory.updated_s + UPDATE_GAP_S
    is_too_soon = now_s < next_revision_s
    is_same = is_as_likely and abs(round(contact_s - advisory.contact_s, 6)) <= MOVED_S
    is_same = is_same and abs(round(separation_m, 3) - advisory.separation_m) <= DEEPER_M
    if is_too_soon or is_same:
        pair.weighed_contact_s, pair.weighed_separation_m = contact_s, separation_m
        pair.weighed_until_s = next_revision_s if is_too_soon else inf
    if is_too_soon:
        return NO_CHANGE
    return UPDATE_IF_MOVED if is_same else UPDATE


@inner
def _has_been_still(pair: Any, is_still: bool, now_s: float, clear_after_s: float) -> bool:
    """Whether both have stood, or one has given way to the other, for long enough."""
    if not is_still:
        pair.still_since_s = inf
    elif pair.still_since_s == inf:
        pair.still_since_s = now_s
    return bool(now_s - pair.still_since_s >= clear_after_s)


@inner
def _decide_with_advisory(pair: Any, advisory: Any, predicted: Any, now_s: float, thresholds: Any) -> int:
    """The code for a pair that has an open advisory. It ends at once if the two are not both there as likely as an
    advisory must be."""
    if predicted.both_present < min(PROBABLY_LEFT, thresholds.raise_probability):
        return MAY_CLEAR
    if _has_been_still(pair, predicted.still, now_s, thresholds.clear_after_s):
        return CLEAR_STILL
    are_close = pair.inside and predicted.both_present >= PROBABLY_LEFT
    if predicted.deciding < thresholds.held_probability and not are_close:
        return _decide_unlikely(pair, advisory, predicted.probability, now_s, thresholds)
    return _decide_update(pair, advisory, predicted, now_s, thresholds)


@inner
def _unpredicted(pairs: NDArray[Any], advisories: NDArray[Any], now_s: float, thresholds: Any) -> tuple[Ints, Ints]:
    """The rows of watched pairs without a prediction of which something may change, and the code of each.

    Without an advisory, nothing changes of a pair that is not updated, unless nothing is left to remember.
    """
    rows, codes, n = np.empty(len(pairs), np.int64), np.full(len(pairs), NO_CHANGE), 0
    for row in range(len(pairs)):
        pair = pairs[row]
        is_open, is_idle = advisories[row].is_open, not (pair.inside or pair.looks)
        if pair.in_use and not pair.predicted and (is_open or is_idle or pair.updated):
            rows[n] = row
            if is_open:
                codes[n] = _decide_unlikely(pair, advisories[row], 0.0, now_s, thresholds)
            n += 1
        pair.predicted = pair.updated = False
    return rows[:n].copy(), codes[:n].copy()


@kernel((_PAIRS, _ADVISORIES, INTS, _PREDICTED, FLOAT, _THRESHOLDS))
def examine_pairs(
    pairs: NDArray[Any],
    advisories: NDArray[Any],
    rows: Ints,
    predictions: NDArray[Any],
    now_s: float,
    thresholds: NDArray[Any],
) -> tuple[Ints, Ints, Ints, Ints]:
    """Which predictions change something, and the code of each; the rows of watched pairs without a prediction of which
    something may change, and the code of each.

    `pairs` and `advisories` (n,) are of `WATCHED_PAIR` and `OPEN_ADVISORY`, `predictions` (p,) of `PREDICTED`,
    `thresholds` (1,) of `THRESHOLDS`. `rows` (p,) are the rows of the predicted pairs, -1 if not watched; new pairs are
    given free rows, of which there must be enough.
    """
    limits = thresholds[0]
    chosen, codes, n, free = np.empty(len(rows), np.int64), np.empty(len(rows), np.int64), 0, 0
    for i in range(len(rows)):
        predicted = predictions[i]
        is_likely, is_new = _is_likely(predicted, now_s, limits), rows[i] < 0
        if is_new:
            if not predicted.fresh or not (is_likely or predicted.start_separation_m <= limits.clearance_m):
                continue
            rows[i] = free = _begin_watch(pairs, free)
        pair, advisory = pairs[rows[i]], advisories[rows[i]]
        is_alerting = _record_look(pair, predicted, is_likely, limits)
        if advisory.is_open:
            code = _decide_with_advisory(pair, advisory, predicted, now_s, limits)
        else:
            code = _decide_without_advisory(pair, predicted, is_new, is_alerting, now_s, limits)
        if code != NO_CHANGE:
            chosen[n], codes[n], n = i, code, n + 1
    return chosen[:n].copy(), codes[:n].copy(), *_unpredicted(pairs, advisories, now_s, limits)


@kernel(BOOLS(_ADVISORIES, INTS, numba.from_dtype(ENCOUNTER)[::1], FLOAT))
def meet_elsewhere(advisories: NDArray[Any], rows: Ints, encounters: Encounters, moved_m: float) -> Bools:
    """(n,) whether `encounters` (n,) may differ from the advisories of `rows` (n,) in class, floor or place.

    Also true if the advisory's floor or the place of the encounter is not known.
    """
    differs = np.empty(len(rows), np.bool_)
    for i in range(len(rows)):
        advisory, met = advisories[rows[i]], encounters[i]
        is_near = hypot(met.x - advisory.x_m, met.y - advisory.y_m) <= moved_m
        is_same_class = met.kind == advisory.encounter_class
        differs[i] = not is_near or not is_same_class or met.floor != advisory.floor or advisory.floor < 0
    return differs
