"""Pairs under watch, in columns: a pass finds by them the few pairs of which something may have to be told."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import compress, repeat
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deconflict.advisories.conflict_wording import (
    DEEPER_M,
    FADES_S,
    LIKELIER,
    MOVED_M,
    MOVED_S,
    SEVERITIES,
    SLACK_S,
    SURE,
    UPDATE_GAP_S,
    Prediction,
    Predictions,
)
from deconflict.advisories.watched_pair_kernels import (
    AS_TOLD,
    BOUNDS,
    LIKELIHOOD,
    NEWS,
    OVER,
    RAISES,
    ROW,
    STILL,
    TOLD,
    UNLIKELY,
    elsewhere,
    stirring,
)
from deconflict.advisory import ConflictAdvisory
from deconflict.foresight.presence.silence_outcomes import PROBABLY_LEFT
from deconflict.settings.site import Conflict
from deconflict.sweep.geometry.encounter import CLASSES, Encounters
from ingest.batch import Floats, Ints, Pair

HELD_SHARE = 0.15
"""An advisory stands until its probability is below this share of the one that raises."""
TOUCHING_M = 0.1
"""A pair that begins nearer than this is touching already, for all that forecasts can tell."""
ROUNDED = 1e-3
"""Probabilities, distances and places are told to so much."""

_NEWLY = np.zeros((), ROW)
_NEWLY["there"], _NEWLY["predicted_s"], _NEWLY["until_s"], _NEWLY["still_since_s"] = True, -inf, -inf, inf


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
    advisory: ConflictAdvisory | None = None


_NOBODY = Track(("", ""), -1)
"""Has the rows that are free."""


class Stirred(NamedTuple):
    """A prediction that may have to be told."""

    track: Track
    prediction: Prediction
    why: int
    """As `stirring` says."""


class Stirring(NamedTuple):
    """What a pass has to look at."""

    found: list[Stirred]
    missed: list[Track]
    """The pairs of which nothing is predicted."""
    rests: list[bool]
    """Whether there is nothing to clear of each: no advisory, or one of which something was predicted lately."""


class Tracks:
    """Every pair under watch."""

    def __init__(self, settings: Conflict) -> None:
        self._remembered = (1 << settings.confirm[1]) - 1
        """A bit for each look that counts."""
        self._bounds = _bounds(settings)
        self._wanted_looks = settings.confirm[0]
        self._row_of: dict[Pair, int] = {}
        self._by_row: list[Track] = []
        self._rows: NDArray[Any] = np.zeros(0, ROW)
        self._told: NDArray[Any] = np.zeros(0, TOLD)

    def get(self, pair: Pair) -> Track | None:
        row = self._row_of.get(pair)
        return None if row is None else self._by_row[row]

    def __len__(self) -> int:
        return len(self._row_of)

    def new(self, pair: Pair) -> Track:
        """A pair that is not under watch yet."""
        self._make_room(1)
        row = int(self._rows["there"].argmin())
        self._rows[row] = _NEWLY
        return self._begun(pair, row)

    def keep(self, track: Track) -> None:
        """Remember a pair as it is now, or forget it where there is nothing left to remember."""
        row = self._rows[track.row]
        if track.advisory is None and not row["inside"] and not row["looks"]:
            row["there"] = False
            del self._row_of[track.pair]

    def tell(self, track: Track, advisory: ConflictAdvisory | None, floor: int | None) -> None:
        """This is the pair's advisory from now on, against which nothing was weighed yet. It is of that floor, -1 where
        that is not known; of the one before if None."""
        track.advisory, row = advisory, self._rows[track.row]
        row["until_s"] = -inf
        if advisory is None:
            self._told["stands"][track.row] = False
            return
        self._told[track.row] = (
            True,
            advisory.time_to_conflict_s == 0,
            SEVERITIES.index(advisory.severity),
            CLASSES.index(advisory.encounter_class),
            self._told["floor"][track.row] if floor is None else floor,
            advisory.updated_at.timestamp(),
            advisory.probability or 0.0,
            advisory.predicted_at.timestamp(),
            advisory.min_separation_m,
            advisory.location.x,
            advisory.location.y,
        )

    def missed(self, track: Track) -> None:
        """Either robot had something new to say, and nothing is predicted."""
        row = self._rows[track.row]
        row["looks"], row["until_s"] = int(row["looks"]) << 1 & self._remembered, -inf

    def part(self, track: Track) -> None:
        """The two have drawn apart."""
        self._rows["inside"][track.row] = False

    def overlook(self, track: Track) -> None:
        """Remember no looks."""
        self._rows["looks"][track.row] = 0

    def met(self, track: Track) -> bool:
        """Whether the two came within the clearance while the advisory stood."""
        return bool(self._rows["met"][track.row])

    def weigh(self, track: Track, one: Weighed) -> None:
        """This is what was weighed last."""
        row = self._rows[track.row]
        row["contact_s"], row["separation_m"], row["sure"], row["until_s"] = one

    def predicted_s(self, track: Track) -> float:
        """When something was last predicted of an advisory's pair."""
        return float(self._rows["predicted_s"][track.row])

    def predict(self, track: Track, now_s: float) -> None:
        """Something is predicted of an advisory's pair."""
        self._rows["predicted_s"][track.row] = now_s

    def stirring(
        self, predictions: Predictions, now_s: float, encounters: Callable[[Sequence[Pair], Floats], Encounters]
    ) -> Stirring:
        """Note what is predicted, and tell which predictions and pairs a pass has to look at.

        A new pair must be within the clearance or likely to come. Of a pair with an advisory nothing is looked at while
        it is not to be told again yet, or has begun; nor what tells the same as its advisory, by `encounters` too (see
        `Scene`); nor what is not fresh and as it was when it was weighed.
        """
        pairs = predictions.pairs
        self._make_room(len(pairs))
        at = np.fromiter(map(self._row_of.get, pairs, repeat(-1)), np.int64, len(pairs))
        stirred, why, missed, rests = stirring(
            self._rows,
            self._told,
            at,
            *predictions[1:6],
            predictions.deciding,
            predictions.still,
            predictions.there,
            self._remembered,
            self._wanted_looks,
            now_s,
            self._bounds,
        )
        some = list(zip(stirred.tolist(), why.tolist(), strict=True))
        differs = self._elsewhere(predictions, at, [row for row, reason in some if reason == AS_TOLD], encounters)
        due = [one for one in some if one[1] in _TO_TELL or one[0] in differs]
        for row, reason in some:
            if reason == OVER:
                del self._row_of[pairs[row]]
            elif pairs[row] not in self._row_of:
                self._begun(pairs[row], int(at[row]))
        said = predictions.some([row for row, _ in due])
        found = [Stirred(self._by_row[at[row]], one, why) for (row, why), one in zip(due, said, strict=True)]
        return Stirring(found, [self._by_row[row] for row in missed.tolist()], rests.tolist())

    def _elsewhere(
        self,
        predictions: Predictions,
        at: Ints,
        some: list[int],
        encounters: Callable[[Sequence[Pair], Floats], Encounters],
    ) -> set[int]:
        """Those of some predictions that tell the same as advisories by which the two may meet elsewhere."""
        if not some:
            return set()
        met = encounters([predictions.pairs[row] for row in some], predictions.contact_s[some])
        return set(compress(some, elsewhere(self._told, at[some], met, MOVED_M - ROUNDED).tolist()))

    def _begun(self, pair: Pair, row: int) -> Track:
        self._row_of[pair], track = row, Track(pair, row)
        self._by_row[row] = track
        return track

    def _make_room(self, pairs: int) -> None:
        """Have free rows for so many more."""
        short = len(self._row_of) + pairs - len(self._rows)
        if short > 0:
            more = max(short, len(self._rows), 16)
            self._rows = np.concatenate([self._rows, np.zeros(more, ROW)])
            self._told = np.concatenate([self._told, np.zeros(more, TOLD)])
            self._by_row += [_NOBODY] * more


def held_probability(settings: Conflict) -> float:
    """A conflict less likely than this lets no advisory stand."""
    return settings.raise_probability * HELD_SHARE


def _bounds(settings: Conflict) -> NDArray[Any]:
    """(1,) of `BOUNDS`."""
    bounds = np.zeros(1, BOUNDS)
    for name, bound in {
        "clearance_m": settings.clearance_m,
        "apart_m": settings.clearance_m + settings.clear_margin_m,
        "touching_m": TOUCHING_M,
        "raises": settings.raise_probability,
        "held": held_probability(settings),
        "sure": SURE,
        "evident": settings.evident_probability,
        "left": PROBABLY_LEFT,
        "urgent_s": settings.urgent_s,
        "clear_after_s": settings.clear_after_s,
        "fades_s": FADES_S,
        "warning_s": settings.warning_s,
        "critical_s": settings.critical_s,
        "slack_s": SLACK_S,
        "gap_s": UPDATE_GAP_S,
        "likelier": LIKELIER - ROUNDED,
        "moved_s": MOVED_S - ROUNDED,
        "deeper_m": DEEPER_M - ROUNDED,
    }.items():
        bounds[name] = bound
    return bounds


_TO_TELL = (RAISES, UNLIKELY, STILL, NEWS, LIKELIHOOD)
