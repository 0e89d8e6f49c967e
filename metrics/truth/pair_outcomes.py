"""Outcomes of pairs: whether two robots got in each other's way within 10 s of a moment.

They do if they meet, which is an encounter at one clearance, or if one yields to the other. Overlapping spans of one
pair are one outcome.
"""

from bisect import bisect_right
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from math import inf
from typing import NamedTuple

from deconflict.foresight.interactions.interaction_finder import InteractionOutcome
from deconflict.foresight.near_misses.warning_before import WITHIN_S
from ingest.batch import Pair
from metrics.truth.encounters import EncounterFinder, RecordedEncounter
from metrics.truth.interactions import Interactions, YieldEvent
from metrics.truth.recorded_motion import RecordedPlace

FRESH_S = 15.0
"""An onset is fresh if the pair was not in each other's way in this time before it."""


class Verdict(IntEnum):
    """The outcome of an alert, or of one second of it."""

    TRUE = 0
    """The pair got in each other's way."""
    KEPT_APART = 1
    """Nothing happened."""
    ORDERED = 2
    """One of the pair waited for the other on an order of their fleet."""
    REPEATED = 3
    """The outcome credits another alert of the pair."""
    HEEDED = 4
    """One of the pair waited as advised, or did what it was asked for the other."""
    UNKNOWN = 5
    """A robot left before an outcome, or it is unknown whether their fleet had ordered a wait."""
    IN_PROGRESS = 6
    """The pair was already in each other's way."""


IN_VAIN = (Verdict.KEPT_APART, Verdict.ORDERED, Verdict.REPEATED)


def outcome_of(verdict: Verdict) -> str:
    """What came of a warning, in the words that people read."""
    if verdict is Verdict.TRUE:
        return "came_true"
    return "in_vain" if verdict in IN_VAIN else "not_judged"


class OutcomeSpan(NamedTuple):
    """A time in which two robots are in each other's way, or one waits for the other."""

    onset_s: float
    """When it begins."""
    end_s: float
    """When it ends."""


@dataclass(slots=True, eq=False)
class PairOutcomes:
    """The outcomes of one pair. Every list is ordered by onset."""

    spans: list[OutcomeSpan] = field(default_factory=list)
    """Spans in which the two were in each other's way. No two overlap."""
    ordered: list[OutcomeSpan] = field(default_factory=list)
    """Spans in which one waited on an order of their fleet."""
    doubted: list[OutcomeSpan] = field(default_factory=list)
    """Spans in which one waited, and it is unknown whether their fleet had ordered it."""
    stops_s: list[float] = field(default_factory=list)
    """Fresh onsets of yielding."""
    meetings_s: list[float] = field(default_factory=list)
    """Fresh onsets of foreseeable encounters."""
    places: dict[float, RecordedPlace | None] = field(default_factory=dict)
    """Where each fresh onset was, by its time."""

    @classmethod
    def of(cls, yield_events: Iterable[YieldEvent], encounters: Iterable[RecordedEncounter]) -> "PairOutcomes":
        by_outcome: dict[InteractionOutcome, list[OutcomeSpan]] = {outcome: [] for outcome in InteractionOutcome}
        places: dict[float, RecordedPlace | None] = {}
        for event in yield_events:
            places[event.onset_s] = event.place
            by_outcome[event.outcome].append(OutcomeSpan(event.onset_s, event.end_s))
        pair = cls(ordered=by_outcome[InteractionOutcome.ORDERED], doubted=by_outcome[InteractionOutcome.UNKNOWN])
        places |= {encounter.start_s: encounter.place for encounter in encounters}
        stops = [(span, pair.stops_s) for span in by_outcome[InteractionOutcome.YIELDED]]
        meetings = [
            (
                OutcomeSpan(encounter.start_s, encounter.end_s),
                pair.meetings_s if encounter.foreseeable else list[float](),
            )
            for encounter in encounters
        ]
        for span, fresh_s in sorted([*stops, *meetings], key=lambda span_and_list: span_and_list[0]):
            if not pair.spans or span.onset_s - pair.spans[-1].end_s > FRESH_S:
                fresh_s.append(span.onset_s)
                pair.places[span.onset_s] = places.get(span.onset_s)
            pair._add(span)
        return pair

    def _add(self, span: OutcomeSpan) -> None:
        if self.spans and span.onset_s <= self.spans[-1].end_s:
            before = self.spans.pop()
            span = OutcomeSpan(before.onset_s, max(before.end_s, span.end_s))
        self.spans.append(span)

    def began_s(self, at_s: float) -> float:
        """When the two next get in each other's way within `WITHIN_S`. `at_s` if they are already; inf if they do
        not."""
        after = bisect_right(self.spans, (at_s, inf))
        if after and self.spans[after - 1].end_s >= at_s:
            return at_s
        is_soon = after < len(self.spans) and self.spans[after].onset_s <= at_s + WITHIN_S
        return self.spans[after].onset_s if is_soon else inf

    def is_doubted(self, at_s: float) -> bool:
        """Whether one waits within `WITHIN_S` for an unknown reason."""
        return _touches(self.doubted, at_s)

    def verdict(self, at_s: float, left_s: float) -> Verdict:
        """The verdict for the moment `at_s`. One of the pair left at `left_s`; inf if neither did."""
        began_s = self.began_s(at_s)
        if began_s < inf:
            return Verdict.IN_PROGRESS if began_s == at_s else Verdict.TRUE
        if self.is_doubted(at_s):
            return Verdict.UNKNOWN
        if _touches(self.ordered, at_s):
            return Verdict.ORDERED
        return Verdict.UNKNOWN if left_s < at_s + WITHIN_S else Verdict.KEPT_APART


NOTHING = PairOutcomes()
"""The outcomes of a pair that neither met nor waited."""


class AllPairOutcomes:
    """The outcomes of all pairs at one clearance, as far as reports show them."""

    def __init__(self, truth: EncounterFinder, interactions: Interactions, clearance_m: float) -> None:
        self._truth, self._interactions, self._clearance_m = truth, interactions, clearance_m

    def of(self, pair: Pair) -> PairOutcomes:
        yield_events = self._interactions.by_pair.get(pair, ())
        encounters = self._truth.by_pair(self._clearance_m).get(pair, ())
        return PairOutcomes.of(yield_events, encounters) if yield_events or encounters else NOTHING

    def pairs(self) -> set[Pair]:
        """The pairs that met or waited, but for two people on foot."""
        found = {*self._interactions.by_pair, *self._truth.by_pair(self._clearance_m)}
        return {pair for pair in found if not self._truth.are_on_foot(pair)}

    def every(self, pairs: Collection[Pair] | None = None) -> dict[Pair, PairOutcomes]:
        """The outcomes of each pair that met or waited, or of these pairs."""
        return {pair: self.of(pair) for pair in sorted(self.pairs() if pairs is None else pairs)}

    def until_s(self, pair: Pair) -> float:
        """Until when a pair was in each other's way, or one waited for the other; inf while it goes on, -inf if it
        never did."""
        if self._truth.goes_on(self._clearance_m, pair):
            return inf
        events = [*self._interactions.by_pair.get(pair, ()), *self._truth.by_pair(self._clearance_m).get(pair, ())]
        return max((event.end_s for event in events), default=-inf)

    def forget(self, pairs: Collection[Pair]) -> None:
        """Forget what happened between the robots of some pairs."""
        for pair in pairs:
            self._interactions.by_pair.pop(pair, None)
        self._truth.forget(pairs)

    def lasting_onsets_s(self, least_s: float) -> dict[Pair, list[float]]:
        """By pair, the onsets of its encounters, and of stops that last at least `least_s`."""
        onsets_s: dict[Pair, list[float]] = {}
        for pair in sorted(self.pairs()):
            events = self._interactions.by_pair.get(pair, ())
            stops = (event for event in events if event.outcome is InteractionOutcome.YIELDED)
            onsets_s[pair] = [event.onset_s for event in stops if event.end_s - event.onset_s >= least_s]
            onsets_s[pair] += (encounter.start_s for encounter in self._truth.by_pair(self._clearance_m).get(pair, ()))
        return onsets_s

    def left_s(self, pair: Pair, from_s: float) -> float:
        """When the first of a pair left, see `Silences.left_s`."""
        return min(self._truth.silences.left_s(robot, from_s) for robot in pair)


def _touches(spans: Sequence[OutcomeSpan], at_s: float) -> bool:
    """Whether any of the spans contains a moment or begins within `WITHIN_S` after it."""
    return any(span.onset_s <= at_s + WITHIN_S and span.end_s >= at_s for span in spans)
