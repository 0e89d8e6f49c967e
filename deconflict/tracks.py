"""Pairs under watch, also in columns: a pass finds by them the few pairs of which anything may have changed."""

from collections import deque
from dataclasses import dataclass
from math import inf
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.advisory import ConflictAdvisory
from deconflict.motion import Bools
from deconflict.telling import LIKELIER, SURE, Pair, Predictions
from ingest.compiled import kernel
from ingest.seam import Floats, Ints

ROUNDED = 1e-3
"""Probabilities are told to so much."""

ROW = np.dtype(
    [(name, np.bool_) for name in ("there", "told", "begun", "inside", "met", "sure", "predicted")]
    + [(name, np.float64) for name in ("contact", "separation", "probability", "until")],
    align=True,
)
"""Whether a track has the row, has an open advisory, of what has begun, is inside and met; what it was `Weighed` to be;
and whether it is predicted in this pass."""

_ROW, _INTS, _FLOATS, _BOOLS = numba.from_dtype(ROW), numba.int64[::1], numba.float64[::1], numba.boolean[::1]


class Weighed(NamedTuple):
    """A prediction that was not worth a revision yet."""

    contact_s: float
    separation_m: float
    sure: bool
    """Whether it was likely enough for its severity."""
    told: float
    """The probability in the revision that it was held against."""
    until_s: float
    """When time alone may make it worth one."""


UNWEIGHED = Weighed(0.0, 0.0, sure=False, told=0.0, until_s=-inf)


@dataclass(slots=True, eq=False)
class Track:
    """One pair under watch."""

    pair: Pair
    row: int
    looks: deque[bool]
    inside: bool = False
    """Within the clearance, or not yet drawn apart from it."""
    met: bool = False
    """Came within the clearance while the advisory stood."""
    weighed: Weighed = UNWEIGHED
    """The newest prediction that was, if nothing new has been said since."""
    advisory: ConflictAdvisory | None = None
    kept: tuple[bool, bool, bool, bool, Weighed] | None = None
    """As it is in the columns: whether it has an advisory, of what has begun, is inside and met; and what was weighed.
    """

    def look(self, *, alerting: bool) -> None:
        """Either robot had something new to say."""
        self.looks.append(alerting)
        self.weighed = UNWEIGHED


class Stirring(NamedTuple):
    """What a pass has to look at."""

    rows: Ints
    """The predictions that may change anything."""
    known: list[Track | None]
    """Their pairs, so far as they are under watch."""
    missed: list[Track]
    """The pairs of which nothing is predicted."""
    rests: list[bool]
    """Whether there is nothing to clear of each: no advisory, or one of which something was predicted lately."""


@kernel(
    numba.types.Tuple((_INTS, _INTS, _BOOLS))(  # type: ignore[no-untyped-call]
        _ROW[::1], _FLOATS, _INTS, *[_FLOATS] * 3, _BOOLS, _FLOATS, *[numba.float64] * 9
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
    now_s: float,
    clearance_m: float,
    apart_m: float,
    raises: float,
    held: float,
    sure: float,
    likelier: float,
    rounded: float,
    lately_s: float,
) -> tuple[Ints, Ints, Bools]:
    some, n = np.empty(len(at), np.int64), 0
    missed, rests, m = np.empty(len(rows), np.int64), np.empty(len(rows), np.bool_), 0
    for one in range(len(at)):
        far = start_m[one] > clearance_m
        if at[one] < 0:
            wanted = max(raises, sure) if separation_m[one] > clearance_m else raises
            if fresh[one] and not (far and (probability[one] < wanted or contact_s[one] <= now_s)):
                some[n] = one
                n += 1
            continue
        row = rows[at[one]]
        row.predicted = True
        still = not fresh[one] and (start_m[one] <= apart_m and (far or row.met) if row.inside else far)
        if still and not row.told:
            continue
        as_weighed = (
            now_s < row.until
            and contact_s[one] == row.contact
            and separation_m[one] == row.separation
            and (probability[one] >= sure) == row.sure
            and abs(probability[one] - row.probability) <= likelier - rounded
        )
        begun = row.begun and contact_s[one] <= now_s
        if still and not row.inside and probability[one] >= held and (begun or as_weighed):
            predicted_s[at[one]] = now_s
            continue
        some[n] = one
        n += 1
    for place in range(len(rows)):
        row = rows[place]
        if row.there and not row.predicted:
            missed[m], rests[m] = place, not row.told or now_s - predicted_s[place] < lately_s
            m += 1
        row.predicted = False
    return some[:n].copy(), missed[:m].copy(), rests[:m].copy()


class Tracks:
    """Every pair under watch."""

    def __init__(self, looks: int) -> None:
        """Of each pair so many looks are remembered."""
        self._looks = looks
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
        track = self._of[pair] = Track(pair, row, deque(maxlen=self._looks))
        if row < len(self._by_row):
            self._by_row[row] = track
        else:
            self._by_row.append(track)
            if row == len(self._rows):
                more = max(row, 16)
                self._rows = np.concatenate([self._rows, np.zeros(more, ROW)])
                self._predicted_s = np.concatenate([self._predicted_s, np.zeros(more)])
        self._predicted_s[row] = -inf
        return track

    def keep(self, track: Track) -> None:
        """Remember a pair as it is now, or forget it where there is nothing left to remember."""
        told, one = track.advisory, track.weighed
        if told or track.inside or any(track.looks):
            begun = told is not None and told.time_to_conflict_s == 0
            state = (told is not None, begun, track.inside, track.met, one)
            if state != track.kept:
                weighed = (one.contact_s, one.separation_m, one.told, one.until_s)
                self._rows[track.row], track.kept = (True, *state[:4], one.sure, False, *weighed), state
        else:
            self._rows[track.row]["there"] = False
            self._free.append(track.row)
            del self._of[track.pair]

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
        clearance_m: float,
        margin_m: float,
        raises: float,
        held: float,
        lately_s: float,
    ) -> Stirring:
        """Which predictions and pairs a pass has to look at.

        What is not fresh changes nothing of a pair that draws near as it did when it was weighed, or is told to have
        met already, is as likely, and no less than `held`; nor of one without an advisory, which stays inside until it
        has drawn apart by `margin_m`. A new pair must be within the clearance or likely to come, which is from a
        probability of `raises` on.
        """
        found = list(map(self._of.get, predictions.pairs))
        at = np.array([-1 if track is None else track.row for track in found], np.int64)
        apart_m = clearance_m + margin_m
        settings = (now_s, clearance_m, apart_m, raises, held, SURE, LIKELIER, ROUNDED, lately_s)
        some, missed, rests = _stirring(self._rows, self._predicted_s, at, *predictions[1:], *settings)
        known = [found[row] for row in some.tolist()]
        return Stirring(some, known, [self._by_row[row] for row in missed.tolist()], rests.tolist())
