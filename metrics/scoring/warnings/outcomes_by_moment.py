"""What came of pairs after moments at which a probability was published for them: of contact, and of getting in each
other's way."""

from collections.abc import Mapping, Sequence
from itertools import chain
from math import inf
from typing import NamedTuple, Protocol

import numpy as np

from deconflict.foresight.interactions.interaction_finder import SETTLED_S
from ingest.batch import Bools, Floats, Ints, Pair
from metrics.truth.encounters import EncounterFinder, RecordedEncounter
from metrics.truth.pair_outcomes import NOTHING, AllPairOutcomes

HORIZON_S = 10.0
SHOWS_S = SETTLED_S + 5.0
"""So long after an onset it shows, and whether the fleet of the two had ordered it."""


class MomentOutcomes(NamedTuple):
    """What came of n pairs, each after a moment. Arrays are (n,)."""

    began_s: Floats
    """When it next began within `HORIZON_S`; the moment itself within one, inf where there is none."""
    left_s: Floats
    """When one of the two left; inf where it is not known to."""
    doubted: Bools
    """Something happened of which it is not known what it was."""


class OutcomeLookup(Protocol):
    """One kind of outcome."""

    @property
    def until_s(self) -> float:
        """It is known of every moment up to `HORIZON_S` before this."""

    def of(self, pairs: Sequence[Pair], which: Ints, at_s: Floats) -> MomentOutcomes:
        """Of `pairs` (p,), n times `which` (n,), after the moments `at_s` (n,)."""


class ContactOutcomes:
    """Encounters at one clearance."""

    def __init__(self, truth: EncounterFinder, clearance_m: float) -> None:
        self._truth, self._clearance_m = truth, clearance_m

    @property
    def until_s(self) -> float:
        return self._truth.until_s

    def of(self, pairs: Sequence[Pair], which: Ints, at_s: Floats) -> MomentOutcomes:
        met: Mapping[Pair, Sequence[RecordedEncounter]] = self._truth.by_pair(self._clearance_m)
        began_s = np.full(len(which), inf)
        for row in np.flatnonzero(np.array([pair in met for pair in pairs])[which]).tolist():
            began_s[row] = _began_s(met[pairs[which[row]]], at_s[row])
        seen_s = {robot: self._truth.motion.last_seen_s(robot) for robot in set(chain.from_iterable(pairs))}
        last_s = np.array([min(seen_s[a], seen_s[b]) for a, b in pairs])[which]
        return MomentOutcomes(began_s, last_s, np.zeros(len(which), np.bool_))


class InteractionOutcomes:
    """Times at which two robots are in each other's way."""

    def __init__(self, truth: EncounterFinder, outcomes: AllPairOutcomes) -> None:
        self._truth, self._outcomes = truth, outcomes

    @property
    def until_s(self) -> float:
        return self._truth.until_s - SHOWS_S

    def of(self, pairs: Sequence[Pair], which: Ints, at_s: Floats) -> MomentOutcomes:
        began_s, left_s = np.full((2, len(which)), inf)
        doubted = np.zeros(len(which), np.bool_)
        every = [self._outcomes.of(pair) for pair in pairs]
        for row in np.flatnonzero(np.array([came is not NOTHING for came in every])[which]).tolist():
            came = every[which[row]]
            began_s[row] = came.began_s(at_s[row])
            doubted[row] = began_s[row] == inf and came.is_doubted(at_s[row])
        leaves = np.array([any(map(self._truth.silences.was_silent, pair)) for pair in pairs])
        for row in np.flatnonzero(leaves[which]).tolist():
            left_s[row] = self._outcomes.left_s(pairs[which[row]], at_s[row])
        return MomentOutcomes(began_s, left_s, doubted)


def _began_s(encounters: Sequence[RecordedEncounter], at_s: float) -> float:
    """When the next one within the horizon begins; `at_s` within one, inf where there is none."""
    began_s = inf
    for one in reversed(encounters):
        if one.start_s <= at_s:
            return at_s if at_s <= one.end_s else began_s
        if one.start_s <= at_s + HORIZON_S:
            began_s = one.start_s
    return began_s
