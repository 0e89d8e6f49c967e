"""Pairs under watch, also in columns: a pass finds by them the few pairs of which anything may have changed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import hypot, inf
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.advisory import ConflictAdvisory
from deconflict.encounter import CLASSES, ENCOUNTER, Encounters
from deconflict.motion import Bools
from deconflict.site import Conflict
from deconflict.telling import DEEPER_M, LIKELIER, MOVED_M, MOVED_S, SEVERITIES, SLACK_S, SURE, Pair, Predictions
from ingest.compiled import inner, kernel
from ingest.seam import Floats, Ints

HELD_SHARE = 0.15
"""An advisory stands until its probability is below this share of the one that raises."""
ROUNDED = 1e-3
"""Probabilities, distances and places are told to so much."""

ROW = np.dtype(
    [(name, np.bool_) for name in ("there", "told", "begun", "inside", "met", "sure", "predicted")]
    + [(name, np.int64) for name in ("looks", "level", "kind", "floor")]
    + [(name, np.float64) for name in ("next", "probability", "contact", "separation", "until")]
    + [(name, np.float64) for name in ("told_contact", "told_separation", "told_x", "told_y")],
    align=True,
)
"""Whether a track has the row, has an open advisory, of what has begun, is inside and met; whether what was `Weighed`
last was likely enough for its severity, and whether something is predicted in this pass. In which of the last looks it
was alerting, the newest in the lowest bit; of its advisory the places among `SEVERITIES` and `CLASSES`, the floor, -1
where it is not known, when the next revision may be told, and the probability; the rest of what was weighed; and when,
how near and where the advisory says that the two meet."""

_ROW, _INTS, _FLOATS, _BOOLS = numba.from_dtype(ROW), numba.int64[::1], numba.float64[::1], numba.boolean[::1]
_REAL = numba.float64

_WHOLE, _TOLD, _AS_TOLD = range(3)
"""What a pass has to look at of a prediction: all; all but what comes before its telling; only how the two meet, as it
is not worth a revision else."""


class Weighed(NamedTuple):
    """A prediction that was not worth a revision yet."""

    contact_s: float
    separation_m: float
    sure: bool
    """Whether it was likely enough for its severity."""
    until_s: float
    """When time alone may make it worth one."""


@dataclass(slots=True, eq=False)
class Track:
    """One pair under watch."""

    pair: Pair
    row: int
    inside: bool = False
    """Within the clearance, or not yet drawn apart from it."""
    met: bool = False
    """Came within the clearance while the advisory stood."""
    advisory: ConflictAdvisory | None = None


class Stirring(NamedTuple):
    """What a pass has to look at."""

    rows: Sequence[int]
    """The predictions that may change anything."""
    known: list[Track | None]
    """Their pairs, so far as they are under watch."""
    told: list[bool]
    """Whether each is of an advisory that stands, and all is noted but what it may tell anew."""
    missed: list[Track]
    """The pairs of which nothing is predicted."""
    rests: list[bool]
    """Whether there is nothing to clear of each: no advisory, or one of which something was predicted lately."""


@inner
def _rises(row: Any, time_s: float, shallow: bool, warning_s: float, critical_s: float) -> bool:
    """Whether an advisory's severity rises, by `telling.severity_of`."""
    reached = (time_s <= warning_s) + (time_s <= critical_s)
    return bool(reached - shallow > row.level)


@inner
def _is_as_severe(row: Any, time_s: float, shallow: bool, warning_s: float, critical_s: float, slack_s: float) -> bool:
    """Whether an advisory's severity stays, by `telling.severity_of`."""
    reached = (time_s <= warning_s + slack_s) + (time_s <= critical_s + slack_s)
    return bool(reached - shallow >= row.level or row.level == 0) and not _rises(
        row, time_s, shallow, warning_s, critical_s
    )


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


@kernel(
    numba.types.Tuple((*[_INTS] * 3, _BOOLS))(  # type: ignore[no-untyped-call]
        _ROW[::1], _FLOATS, _INTS, *[_FLOATS] * 3, _BOOLS, _FLOATS, numba.int64, *[_REAL] * 14
    )
)
def _stirring(
    rows: NDArray[Any],
    predicted_s: Floats,
    at: Ints,
    contact_s: Floats,
    separation_m: Floats,
    start_m: Floats,
    fresh: Bools,
    probability: Floats,
    remembered: int,
    now_s: float,
    clearance_m: float,
    apart_m: float,
    raises: float,
    held: float,
    lately_s: float,
    warning_s: float,
    critical_s: float,
    slack_s: float,
    sure: float,
    likelier: float,
    moved_s: float,
    deeper_m: float,
    rounded: float,
) -> tuple[Ints, Ints, Ints, Bools]:
    some, looks, n = np.empty(len(at), np.int64), np.empty(len(at), np.int64), 0
    missed, rests, m = np.empty(len(rows), np.int64), np.empty(len(rows), np.bool_), 0
    for one in range(len(at)):
        far, is_sure, ahead = start_m[one] > clearance_m, probability[one] >= sure, contact_s[one] > now_s
        wanted = max(raises, sure) if separation_m[one] > clearance_m else raises
        likely = probability[one] >= wanted and ahead
        if at[one] < 0:
            if fresh[one] and (likely or not far):
                some[n], looks[n] = one, _WHOLE
                n += 1
            continue
        row = rows[at[one]]
        row.predicted = True
        as_far = not fresh[one] and (start_m[one] <= apart_m and (far or row.met) if row.inside else far)
        if as_far and not row.told:
            continue
        look = _WHOLE
        if row.told and far and not row.inside and probability[one] >= held:
            begun = row.begun and not ahead
            as_weighed = (
                now_s < row.until
                and contact_s[one] == row.contact
                and separation_m[one] == row.separation
                and is_sure == row.sure
                and abs(probability[one] - row.probability) <= likelier - rounded
            )
            shallow = separation_m[one] > clearance_m / 2 or not is_sure
            time_s = contact_s[one] - now_s
            soon = now_s < row.next and not _rises(row, time_s, shallow, warning_s, critical_s)
            as_told = (
                _is_as_severe(row, time_s, shallow, warning_s, critical_s, slack_s)
                and abs(contact_s[one] - row.told_contact) <= moved_s - rounded
                and abs(probability[one] - row.probability) <= likelier - rounded
                and abs(separation_m[one] - row.told_separation) <= deeper_m - rounded
            )
            predicted_s[at[one]] = now_s
            if fresh[one]:
                row.looks, row.until = (row.looks << 1 | likely) & remembered, -inf
            still = as_weighed and not fresh[one]
            if not begun and (soon or (as_told and not still)):
                until_s = _until_s(contact_s[one], now_s, warning_s, critical_s, slack_s)
                row.contact, row.separation, row.sure = contact_s[one], separation_m[one], is_sure
                row.until = min(until_s, row.next) if soon else until_s
            if begun or soon or still:
                continue
            look = _AS_TOLD if as_told else _TOLD
        some[n], looks[n] = one, look
        n += 1
    for place in range(len(rows)):
        row = rows[place]
        if row.there and not row.predicted:
            missed[m], rests[m] = place, not row.told or now_s - predicted_s[place] < lately_s
            m += 1
        row.predicted = False
    return some[:n].copy(), looks[:n].copy(), missed[:m].copy(), rests[:m].copy()


@kernel(_BOOLS(_ROW[::1], _INTS, numba.from_dtype(ENCOUNTER)[::1], _REAL))
def _elsewhere(rows: NDArray[Any], at: Ints, met: Encounters, moved_m: float) -> Bools:
    """Whether advisories may say of two another class, floor or place than that they meet so; also where they do not
    tell the floor, or the place is not known."""
    differs = np.empty(len(at), np.bool_)
    for one in range(len(at)):
        row, now = rows[at[one]], met[one]
        near = hypot(now.x - row.told_x, now.y - row.told_y) <= moved_m
        differs[one] = not near or now.kind != row.kind or now.floor != row.floor or row.floor < 0
    return differs


_NEW = np.zeros((), ROW)
_NEW["floor"] = -1


class Tracks:
    """Every pair under watch."""

    def __init__(self, looks: int) -> None:
        """Of each pair so many looks are remembered."""
        self._remembered = (1 << looks) - 1
        self._of: dict[Pair, Track] = {}
        self._by_row: list[Track] = []
        self._free: list[int] = []
        self._rows: NDArray[Any] = np.zeros(0, ROW)
        self._predicted_s = np.zeros(0)

    def get(self, pair: Pair) -> Track | None:
        return self._of.get(pair)

    def __len__(self) -> int:
        return len(self._of)

    def new(self, pair: Pair) -> Track:
        """A pair that is not under watch yet; `keep` it, or it is as if it weren't."""
        row = self._free.pop() if self._free else len(self._by_row)
        track = self._of[pair] = Track(pair, row)
        if row < len(self._by_row):
            self._by_row[row] = track
        else:
            self._by_row.append(track)
            if row == len(self._rows):
                more = max(row, 16)
                self._rows = np.concatenate([self._rows, np.zeros(more, ROW)])
                self._predicted_s = np.concatenate([self._predicted_s, np.zeros(more)])
        self._rows[row], self._predicted_s[row] = _NEW, -inf
        return track

    def keep(self, track: Track) -> None:
        """Remember a pair as it is now, or forget it where there is nothing left to remember."""
        row = self._rows[track.row]
        row["there"] = track.advisory is not None or track.inside or row["looks"]
        if row["there"]:
            row["inside"], row["met"] = track.inside, track.met
        else:
            self._free.append(track.row)
            del self._of[track.pair]

    def tell(self, track: Track, advisory: ConflictAdvisory | None, next_s: float, floor: int | None) -> None:
        """This is the pair's advisory from now on, against which nothing was weighed yet, of which the next revision
        may be told from `next_s` on. It is of that floor, -1 where that is not known; of the one before if None."""
        track.advisory, row = advisory, self._rows[track.row]
        row["told"], row["until"], row["next"] = advisory is not None, -inf, next_s
        if advisory:
            row["begun"], row["level"] = advisory.time_to_conflict_s == 0, SEVERITIES.index(advisory.severity)
            row["probability"] = advisory.probability or 0.0
            row["kind"], row["told_separation"] = CLASSES.index(advisory.encounter_class), advisory.min_separation_m
            row["told_contact"] = advisory.predicted_at.timestamp()
            row["told_x"], row["told_y"] = advisory.location.x, advisory.location.y
            if floor is not None:
                row["floor"] = floor

    def look(self, track: Track, *, alerting: bool) -> None:
        """Either robot had something new to say."""
        row = self._rows[track.row]
        row["looks"], row["until"] = (int(row["looks"]) << 1 | alerting) & self._remembered, -inf

    def alerting(self, track: Track) -> int:
        """In how many of the looks that are remembered the pair was alerting."""
        return int(self._rows[track.row]["looks"]).bit_count()

    def overlook(self, track: Track) -> None:
        """Remember no looks."""
        self._rows[track.row]["looks"] = 0

    def weigh(self, track: Track, one: Weighed) -> None:
        """This is what was weighed last."""
        row = self._rows[track.row]
        row["contact"], row["separation"], row["sure"], row["until"] = one

    def predicted_s(self, track: Track) -> float:
        """When something was last predicted of an advisory's pair."""
        return float(self._predicted_s[track.row])

    def predict(self, track: Track, now_s: float) -> None:
        """Something is predicted of an advisory's pair."""
        self._predicted_s[track.row] = now_s

    def stirring(
        self,
        predictions: Predictions,
        now_s: float,
        settings: Conflict,
        encounters: Callable[[Sequence[Pair], Floats], Encounters],
    ) -> Stirring:
        """Which predictions and pairs a pass has to look at.

        What is not fresh changes nothing of a pair that draws near as it did when it was weighed, is as likely, and
        likely enough for its advisory to stand; nor of one without an advisory, which stays inside until it has drawn
        apart. Nor does what is fresh while its advisory is not to be told again yet, or has begun, but that either
        robot was heard, nor what tells the same as its advisory, by `encounters` too (see `Scene`). A new pair must be
        within the clearance or likely to come.
        """
        found = list(map(self._of.get, predictions.pairs))
        at = np.array([-1 if track is None else track.row for track in found], np.int64)
        some, looks, missed, rests = _stirring(
            self._rows,
            self._predicted_s,
            at,
            *predictions[1:],
            self._remembered,
            now_s,
            settings.clearance_m,
            settings.clearance_m + settings.clear_margin_m,
            settings.raise_probability,
            settings.raise_probability * HELD_SHARE,
            settings.clear_after_s,
            settings.warning_s,
            settings.critical_s,
            SLACK_S,
            SURE,
            LIKELIER,
            MOVED_S,
            DEEPER_M,
            ROUNDED,
        )
        rows, told = some.tolist(), looks.tolist()
        if _AS_TOLD in told:
            same = some[looks == _AS_TOLD]
            met = encounters([predictions.pairs[row] for row in same.tolist()], predictions.contact_s[same])
            differs = iter(_elsewhere(self._rows, at[same], met, MOVED_M - ROUNDED).tolist())
            stirred = [(row, look) for row, look in zip(rows, told, strict=True) if look != _AS_TOLD or next(differs)]
            rows, told = [row for row, _ in stirred], [look for _, look in stirred]
        missing = [self._by_row[row] for row in missed.tolist()]
        return Stirring(rows, [found[row] for row in rows], [look != _WHOLE for look in told], missing, rests.tolist())
