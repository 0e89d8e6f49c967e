"""The table of watched pairs: one row of columns for each, so that kernels look at all of them at once.

A pair is watched while it has an open advisory, is within the clearance, or had an alerting look lately. The
columns are named in `watched_pair_rows`.
"""

from collections.abc import Callable, Container, Iterable, Sequence, Set
from dataclasses import dataclass
from itertools import compress, repeat
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deconflict.advisories import revision_rules
from deconflict.advisories.severity import SEVERITIES
from deconflict.advisories.watched.watched_pair_kernels import (
    FORGET,
    UPDATE_IF_MOVED,
    WATCH,
    examine_pairs,
    meet_elsewhere,
)
from deconflict.advisories.watched.watched_pair_rows import OPEN_ADVISORY, PREDICTED, THRESHOLDS, WATCHED_PAIR
from deconflict.foresight.conflict_predictions import Prediction, Predictions
from deconflict.foresight.keyed_tables import KeyedTable
from deconflict.settings.site import Conflict
from deconflict.sweep.geometry.encounter import CLASSES, Encounters
from deconflict_client.advisory import ConflictAdvisory
from ingest.batch import Floats, Ints, Pair

MOST_SPARE = 8
"""The table has at most so many times the rows that it needs."""
ROUNDED = 1e-3
"""Advisories give places rounded to this, so a move is surely too small only so far below its bound."""

_NEW_ROW = np.zeros((), WATCHED_PAIR)
_NEW_ROW["in_use"], _NEW_ROW["still_since_s"], _NEW_ROW["lower_since_s"] = True, inf, inf
_NEW_ROW["predicted_s"], _NEW_ROW["weighed_until_s"] = -inf, -inf


@dataclass(slots=True, eq=False)
class WatchedPair:
    """One watched pair."""

    pair: Pair
    row: int
    advisory: ConflictAdvisory | None = None
    """The newest revision of its open advisory."""


_NO_PAIR = WatchedPair(("", ""), -1)
"""Stands in the rows that are free."""


class FoundPrediction(NamedTuple):
    """A prediction that changes something, or may."""

    watched: WatchedPair
    prediction: Prediction
    code: int
    """One of the codes of `watched_pair_kernels`, from `RAISE` on."""


class Examination(NamedTuple):
    """What one pass has to look at."""

    found: list[FoundPrediction]
    unpredicted: list[tuple[WatchedPair, int]]
    """Watched pairs without a prediction, and the code of each: all with an advisory, and without one those of which
    something may change."""


class WatchedPairs:
    """Every watched pair."""

    def __init__(self, settings: Conflict) -> None:
        self._thresholds = _thresholds(settings)
        self._looks_mask = int(self._thresholds["looks_mask"][0])
        self._row_of: dict[Pair, int] = {}
        self._others: dict[str, dict[str, WatchedPair]] = {}
        """By robot, its watched pairs by the other robot."""
        self._by_row: list[WatchedPair] = []
        self._pairs: NDArray[Any] = np.zeros(0, WATCHED_PAIR)
        self._advisories: NDArray[Any] = np.zeros(0, OPEN_ADVISORY)

    def __len__(self) -> int:
        return len(self._row_of)

    def all(self) -> Iterable[Pair]:
        """Every watched pair."""
        return self._row_of.keys()

    def get(self, pair: Pair) -> WatchedPair | None:
        row = self._row_of.get(pair)
        return None if row is None else self._by_row[row]

    def among(self, robots: Container[str], changed: Set[str]) -> list[WatchedPair]:
        """The watched pairs of two of `robots`, of which at least one is in `changed`."""
        return [
            watched for watched in self.of_robots(changed) if watched.pair[0] in robots and watched.pair[1] in robots
        ]

    def of_robots(self, robots: Set[str]) -> Iterable[WatchedPair]:
        """The watched pairs of which at least one robot is in `robots`."""
        watched = (each for uuid in self._others.keys() & robots for each in self._others[uuid].values())
        return {each.pair: each for each in watched}.values()

    def add(self, pair: Pair) -> WatchedPair:
        """Watch a pair that is not watched yet."""
        self._make_room(1)
        row = int(self._pairs["in_use"].argmin())
        self._pairs[row] = _NEW_ROW
        return self._register(pair, row)

    def watch_only(self, pairs: Set[Pair]) -> None:
        """Watch these pairs, and of others those with an open advisory."""
        for pair in pairs - self._row_of.keys():
            self.add(pair)
        for pair, row in list(self._row_of.items()):
            if pair not in pairs and not self._by_row[row].advisory:
                self._pairs["in_use"][row] = False
                self._unregister(pair)

    def table(self) -> KeyedTable:
        """What is remembered of each pair."""
        columns = {name: self._pairs[name] for name in WATCHED_PAIR.names or () if name != "in_use"}
        return KeyedTable(list(self._row_of), list(self._row_of.values()), columns)

    def forget_if_idle(self, watched: WatchedPair) -> None:
        """Stop to watch a pair of which there is nothing left to remember."""
        row = self._pairs[watched.row]
        if watched.advisory is None and not row["inside"] and not row["looks"]:
            row["in_use"] = False
            self._unregister(watched.pair)

    def set_advisory(self, watched: WatchedPair, advisory: ConflictAdvisory | None, floor: int | None) -> None:
        """Set the newest revision of a pair's open advisory, with which nothing has been compared yet.

        `floor` is the index of its floor, -1 if that is not known; None keeps the floor of the revision before.
        """
        before, watched.advisory = watched.advisory, advisory
        self._pairs["weighed_until_s"][watched.row] = -inf
        if before is None or advisory is None or before.severity is not advisory.severity:
            self._pairs["lower_since_s"][watched.row] = inf
        if advisory is None:
            self._advisories["is_open"][watched.row] = False
            return
        self._advisories[watched.row] = (
            True,
            advisory.time_to_conflict_s == 0,
            SEVERITIES.index(advisory.severity),
            CLASSES.index(advisory.encounter_class),
            self._advisories["floor"][watched.row] if floor is None else floor,
            advisory.updated_at.timestamp(),
            advisory.probability or 0.0,
            advisory.predicted_at.timestamp(),
            advisory.min_separation_m,
            advisory.location.x,
            advisory.location.y,
        )

    def record_quiet_look(self, watched: WatchedPair) -> None:
        """Record that a robot has a new forecast by which nothing is predicted."""
        row = self._pairs[watched.row]
        row["looks"], row["weighed_until_s"] = int(row["looks"]) << 1 & self._looks_mask, -inf

    def mark_apart(self, watched: WatchedPair) -> None:
        """Record that the two have drawn apart."""
        self._pairs["inside"][watched.row] = False

    def forget_looks(self, watched: WatchedPair) -> None:
        self._pairs["looks"][watched.row] = 0

    def have_met(self, watched: WatchedPair) -> bool:
        """Whether the two came within the clearance while the advisory was open."""
        return bool(self._pairs["met"][watched.row])

    def predicted_s(self, watched: WatchedPair) -> float:
        """When a pair with an advisory was last predicted as likely enough."""
        return float(self._pairs["predicted_s"][watched.row])

    def set_predicted_s(self, watched: WatchedPair, at_s: float) -> None:
        self._pairs["predicted_s"][watched.row] = at_s

    def examine(
        self,
        predictions: Predictions,
        updated: Set[str],
        now_s: float,
        encounters: Callable[[Sequence[Pair], Floats], Encounters],
    ) -> Examination:
        """Record the predictions of a pass; return those that change something, and the pairs without a prediction of
        which something may change.

        Which predictions these are stands in `watched_pair_kernels`. `updated` are the robots with a new forecast, and
        those that have left. `encounters` says how pairs meet, as `LiveScene.encounters` does.
        """
        pairs = predictions.pairs
        self._make_room(len(pairs))
        self._drop_free_rows(len(self._row_of) + len(pairs))
        self._pairs["updated"][[watched.row for watched in self.of_robots(updated)]] = True
        rows = np.fromiter(map(self._row_of.get, pairs, repeat(-1)), np.int64, len(pairs))
        predicted = np.empty(len(pairs), PREDICTED)
        for name in PREDICTED.names or ():
            predicted[name] = getattr(predictions, name)
        chosen, codes, unpredicted, quiet_codes = examine_pairs(
            self._pairs, self._advisories, rows, predicted, now_s, self._thresholds
        )
        coded = list(zip(chosen.tolist(), codes.tolist(), strict=True))
        same = [i for i, code in coded if code == UPDATE_IF_MOVED]
        moved = self._moved(predictions, rows, same, encounters)
        for i, code in coded:
            if code == FORGET:
                self._unregister(pairs[i])
            elif pairs[i] not in self._row_of:
                self._register(pairs[i], int(rows[i]))
        due = [(i, code) for i, code in coded if code not in _NOT_DUE or i in moved]
        found = [
            FoundPrediction(self._by_row[rows[i]], prediction, code)
            for (i, code), prediction in zip(due, predictions.at([i for i, _ in due]), strict=True)
        ]
        quiet = [self._by_row[row] for row in unpredicted.tolist()]
        return Examination(found, list(zip(quiet, quiet_codes.tolist(), strict=True)))

    def _moved(
        self,
        predictions: Predictions,
        rows: Ints,
        chosen: list[int],
        encounters: Callable[[Sequence[Pair], Floats], Encounters],
    ) -> set[int]:
        """Those of some predictions whose pairs may meet in another way or place than their advisories say."""
        if not chosen:
            return set()
        met = encounters([predictions.pairs[i] for i in chosen], predictions.contact_s[chosen])
        limit_m = revision_rules.MOVED_M - ROUNDED
        return set(compress(chosen, meet_elsewhere(self._advisories, rows[chosen], met, limit_m).tolist()))

    def _register(self, pair: Pair, row: int) -> WatchedPair:
        watched = WatchedPair(pair, row)
        self._row_of[pair], self._by_row[row] = row, watched
        for uuid, other in (pair, pair[::-1]):
            self._others.setdefault(uuid, {})[other] = watched
        return watched

    def _unregister(self, pair: Pair) -> None:
        del self._row_of[pair]
        for uuid, other in (pair, pair[::-1]):
            del self._others[uuid][other]
            if not self._others[uuid]:
                del self._others[uuid]

    def _make_room(self, pairs: int) -> None:
        """Have free rows for this many more pairs."""
        missing = len(self._row_of) + pairs - len(self._pairs)
        if missing > 0:
            more = max(missing, len(self._pairs), 16)
            self._pairs = np.concatenate([self._pairs, np.zeros(more, WATCHED_PAIR)])
            self._advisories = np.concatenate([self._advisories, np.zeros(more, OPEN_ADVISORY)])
            self._by_row += [_NO_PAIR] * more

    def _drop_free_rows(self, needed: int) -> None:
        """Make a table shorter that has many more rows than `needed`: each pass looks at all of them."""
        if len(self._pairs) <= MOST_SPARE * max(needed, 16):
            return
        rows = np.flatnonzero(self._pairs["in_use"])
        self._pairs, self._advisories = self._pairs[rows], self._advisories[rows]
        self._by_row = [self._by_row[row] for row in rows.tolist()]
        for row, watched in enumerate(self._by_row):
            watched.row = self._row_of[watched.pair] = row
        self._make_room(needed)


_NOT_DUE = (WATCH, FORGET, UPDATE_IF_MOVED)


def _thresholds(settings: Conflict) -> NDArray[Any]:
    """(1,) of `THRESHOLDS`."""
    thresholds = np.zeros(1, THRESHOLDS)
    for name, value in {
        "clearance_m": settings.clearance_m,
        "apart_m": settings.apart_m,
        "raise_probability": settings.raise_probability,
        "held_probability": revision_rules.held_probability(settings),
        "evident": settings.evident_probability,
        "urgent_s": settings.urgent_s,
        "clear_after_s": settings.clear_after_s,
        "warning_s": settings.warning_s,
        "critical_s": settings.critical_s,
        "looks_mask": (1 << settings.confirm[1]) - 1,
        "looks_needed": settings.confirm[0],
    }.items():
        thresholds[name] = value
    return thresholds
