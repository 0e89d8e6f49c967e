"""The outcomes of each pair as intervals: it met, or one yielded; and which outcomes should have had a warning."""

from bisect import bisect_left
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import inf

from benchmarks.planned_floors.truth.encounters import Encounter, Pair, encounters
from benchmarks.planned_floors.truth.floor_truth import FloorTruth, Stop

FRESH_S = 15.0
"""A pair with a stop within this time before is already yielding."""
FRESH_MPS, FRESH_STANDING_S = 0.3, 1.0
PASS_M = 1.0
"""Robots of two vendors that come this near without an outcome pass each other."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """One time at which a pair got in each other's way."""

    pair: Pair
    onset_s: float
    end_s: float


@dataclass(frozen=True, eq=False)
class Happenings:
    """The true outcomes of all pairs of a floor."""

    outcomes: dict[Pair, list[Outcome]]
    """By pair, ordered by onset. Outcomes of one pair do not overlap."""
    met: list[Encounter]
    """All encounters."""
    stops: list[Stop]
    """Fresh stops, which should have had a warning."""
    encounters: list[Encounter]
    """Natural encounters: foreseeable, and neither robot was driving around another."""
    passes: list[Encounter]
    """Runs within `PASS_M` of robots of two vendors without an outcome."""

    @cached_property
    def warnable(self) -> list[tuple[Pair, float]]:
        """Pair and onset of each outcome that should have had a warning: of its first fresh stop or natural
        encounter."""
        begun = [(stop.start_s, stop.pair) for stop in self.stops]
        begun += [(encounter.start_s, encounter.pair) for encounter in self.encounters]
        first: dict[tuple[Pair, float], float] = {}
        for start_s, pair in sorted(begun):
            first.setdefault((pair, self._onset_s(pair, start_s)), start_s)
        return [(pair, start_s) for (pair, _), start_s in first.items()]

    def _onset_s(self, pair: Pair, t_s: float) -> float:
        """The onset of the outcome that the pair is in at a time, or was in last."""
        return max(outcome.onset_s for outcome in self.outcomes[pair] if outcome.onset_s <= t_s)

    def in_progress(self, pair: Pair, t_s: float) -> bool:
        """Whether the pair is in each other's way at a time."""
        return any(outcome.onset_s <= t_s <= outcome.end_s for outcome in self.outcomes.get(pair, ()))

    def next_onset_s(self, pair: Pair, t_s: float) -> float:
        """The first onset of the pair after a time; inf if there is none."""
        onsets_s = [outcome.onset_s for outcome in self.outcomes.get(pair, ())]
        index = bisect_left(onsets_s, t_s + 1e-9)
        return onsets_s[index] if index < len(onsets_s) else inf


def happenings(truth: FloorTruth, clearance_m: float, vendor_of: dict[str, str]) -> Happenings:
    met = encounters(truth.motion, clearance_m)
    half_width_m = dict(zip(truth.motion.robots, truth.motion.half_m[1].tolist(), strict=True))
    gave_way = [stop for stop in truth.stops if not stop.same_vendor and stop.gives_way(half_width_m[stop.robot])]
    spans = [Outcome(stop.pair, stop.start_s, stop.around_until_s) for stop in gave_way]
    outcomes = _joined(spans + [Outcome(encounter.pair, encounter.start_s, encounter.end_s) for encounter in met])
    return Happenings(
        outcomes, met, fresh(truth.stops, half_width_m), natural(met, truth.stops), _passes(truth, outcomes, vendor_of)
    )


def fresh(stops: Iterable[Stop], half_width_m: Mapping[str, float]) -> list[Stop]:
    """Stops of at least a second, from a speed worth the name, of pairs that were not yielding before.

    A robot that slows down or swerves need not stand: it must give way.
    """
    last_s: dict[Pair, float] = {}
    found = []
    for stop in sorted(stops, key=lambda stop: (stop.start_s, -stop.v0_mps)):
        before_s = last_s.get(stop.pair, -inf)
        moves_on = stop.kind != "stop" and stop.gives_way(half_width_m[stop.robot])
        stood = stop.standing_s >= FRESH_STANDING_S
        if (
            (stood or moves_on)
            and stop.v0_mps > FRESH_MPS
            and not stop.same_vendor
            and stop.start_s - before_s > FRESH_S
        ):
            found.append(stop)
        last_s[stop.pair] = max(before_s, stop.end_s)
    return found


def natural(met: Iterable[Encounter], stops: Iterable[Stop]) -> list[Encounter]:
    """Foreseeable encounters that began while neither robot was driving around another."""
    around: dict[str, list[tuple[float, float]]] = {}
    for stop in stops:
        if stop.around:
            around.setdefault(stop.robot, []).append((stop.end_s - 1.0, stop.around_until_s))
    return [
        encounter
        for encounter in met
        if encounter.foreseeable
        and not any(
            begin_s <= encounter.start_s <= end_s
            for robot in encounter.pair
            for begin_s, end_s in around.get(robot, ())
        )
    ]


def _joined(spans: list[Outcome]) -> dict[Pair, list[Outcome]]:
    """Merge overlapping outcomes of one pair."""
    outcomes: dict[Pair, list[Outcome]] = {}
    for span in sorted(spans, key=lambda span: span.onset_s):
        of_pair = outcomes.setdefault(span.pair, [])
        if of_pair and span.onset_s <= of_pair[-1].end_s:
            before = of_pair.pop()
            span = Outcome(span.pair, before.onset_s, max(before.end_s, span.end_s))  # noqa: PLW2901
        of_pair.append(span)
    return outcomes


def _passes(truth: FloorTruth, outcomes: dict[Pair, list[Outcome]], vendor_of: dict[str, str]) -> list[Encounter]:
    def undisturbed(passed: Encounter) -> bool:
        from_s, to_s = passed.start_s - FRESH_S, passed.end_s + FRESH_S
        return not any(outcome.onset_s <= to_s and outcome.end_s >= from_s for outcome in outcomes.get(passed.pair, ()))

    return [
        passed
        for passed in encounters(truth.motion, PASS_M)
        if vendor_of[passed.pair[0]] != vendor_of[passed.pair[1]] and passed.foreseeable and undisturbed(passed)
    ]
