"""Outcomes of pairs after moments at which a probability was published for them: contact, and interactions, in which
the two get in each other's way."""

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
"""An onset, and whether the fleet had ordered it, is known this long after it."""


class MomentOutcomes(NamedTuple):
    """The next outcome of n pairs, each after a moment. Arrays are (n,)."""

    began_s: Floats
    """When the next outcome began within `HORIZON_S`. The moment itself if one is in progress; inf if there is none."""
    left_s: Floats
    """When one of the two left; inf if neither is known to have left."""
    doubted: Bools
    """Whether something happened whose kind is unknown."""


class OutcomeLookup(Protocol):
    """Finds outcomes of one kind."""

    @property
    def until_s(self) -> float:
        """Outcomes are known for every moment up to `HORIZON_S` before this."""

    def after(self, pairs: Sequence[Pair], which: Ints, at_s: Floats) -> MomentOutcomes:
        """The outcomes after the moments `at_s` (n,). `which` (n,) is the index in `pairs` (p,) at each moment."""


class ContactOutcomes:
    """Outcomes of contact: encounters at one clearance."""

    def __init__(self, truth: EncounterFinder, clearance_m: float) -> None:
        self._truth, self._clearance_m = truth, clearance_m

    @property
    def until_s(self) -> float:
        return self._truth.until_s

    def after(self, pairs: Sequence[Pair], which: Ints, at_s: Floats) -> MomentOutcomes:
        encounters: Mapping[Pair, Sequence[RecordedEncounter]] = self._truth.by_pair(self._clearance_m)
        began_s = np.full(len(which), inf)
        for row in np.flatnonzero(np.array([pair in encounters for pair in pairs])[which]).tolist():
            began_s[row] = _began_s(encounters[pairs[which[row]]], at_s[row])
        seen_s = {robot: self._truth.motion.last_seen_s(robot) for robot in set(chain.from_iterable(pairs))}
        last_s = np.array([min(seen_s[a], seen_s[b]) for a, b in pairs])[which]
        return MomentOutcomes(began_s, last_s, np.zeros(len(which), np.bool_))


class InteractionOutcomes:
    """Outcomes of interactions: times at which two robots are in each other's way."""

    def __init__(self, truth: EncounterFinder, outcomes: AllPairOutcomes) -> None:
        self._truth, self._outcomes = truth, outcomes

    @property
    def until_s(self) -> float:
        return self._truth.until_s - SHOWS_S

    def after(self, pairs: Sequence[Pair], which: Ints, at_s: Floats) -> MomentOutcomes:
        began_s, left_s = np.full((2, len(which)), inf)
        doubted = np.zeros(len(which), np.bool_)
        every = [self._outcomes.of(pair) for pair in pairs]
        for row in np.flatnonzero(
            np.array([outcomes_of_pair is not NOTHING for outcomes_of_pair in every])[which]
        ).tolist():
            outcomes_of_pair = every[which[row]]
            began_s[row] = outcomes_of_pair.began_s(at_s[row])
            doubted[row] = began_s[row] == inf and outcomes_of_pair.is_doubted(at_s[row])
        can_leave = np.array([any(map(self._truth.silences.was_silent, pair)) for pair in pairs])
        for row in np.flatnonzero(can_leave[which]).tolist():
            left_s[row] = self._outcomes.left_s(pairs[which[row]], at_s[row])
        return MomentOutcomes(began_s, left_s, doubted)


def _began_s(encounters: Sequence[RecordedEncounter], at_s: float) -> float:
    """When the next encounter within the horizon begins. `at_s` if one is in progress; inf if there is none."""
    began_s = inf
    for encounter in reversed(encounters):
        if encounter.start_s <= at_s:
            return at_s if at_s <= encounter.end_s else began_s
        if encounter.start_s <= at_s + HORIZON_S:
            began_s = encounter.start_s
    return began_s
