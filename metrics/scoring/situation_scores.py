"""Scores of situations: what came of each, and how many a person had to look at.

A situation came true if an outcome of two of its robots (`metrics/truth/pair_outcomes.py`) began while it listed both,
or within 10 s after that, or if one of its other advisories came true (`contention_scores.py`).
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, product
from math import floor, inf, isfinite, nan
from typing import Any, NamedTuple

import numpy as np

from deconflict.advisories.situations.situation_counts import counted
from deconflict.foresight.near_misses.warning_before import WITHIN_S
from deconflict_client.advisory import AdvisoryState, SituationKind
from deconflict_client.situations import Situation
from ingest.batch import Floats, Pair
from metrics.scoring.bootstrap import interval
from metrics.scoring.contention_scores import AlertOutcome
from metrics.scoring.summaries import letters, mean, means, median, spread
from metrics.truth.advised_waits import AdvisedWaits
from metrics.truth.pair_outcomes import NOTHING, OutcomeSpan, PairOutcomes, Verdict
from metrics.truth.resource_use import TimeSpan

LONG_STOP_S = 3.0
"""A shorter stop need not be part of a situation."""
AHEAD_S = 3.0
"""An outcome was foreseen early if an advisory of its pair was raised so long before."""
AGAIN_S = 60.0
"""What comes back sooner had better been one situation."""


@dataclass(slots=True, eq=False)
class SituationCase:
    """One situation, from its revisions so far."""

    kind: SituationKind
    """When it was raised."""
    raised_s: float
    cleared_s: float = inf
    first_robots: tuple[str, ...] = ()
    """Those that were listed when it was raised."""
    is_changed: bool = False
    """Whether it is about robots, and lists fewer of its subject's than an advisory on it has."""
    listed: dict[str, list[TimeSpan]] = field(default_factory=dict)
    """By robot, when it was listed; the last span ends at inf while it is."""
    advisories: set[str] = field(default_factory=set)
    """Ids of its advisories, of all revisions."""

    def add(self, revision: Situation) -> None:
        at_s, is_cleared = revision.updated_at.timestamp(), revision.state is AdvisoryState.CLEARED
        robots = () if is_cleared else revision.robots
        for robot, spans in self.listed.items():
            if spans[-1].to_s == inf and robot not in robots:
                spans[-1] = TimeSpan(spans[-1].from_s, at_s)
        for robot in robots:
            spans = self.listed.setdefault(robot, [])
            if not spans or spans[-1].to_s < inf:
                spans.append(TimeSpan(at_s, inf))
        self.advisories.update(revision.advisories)
        if is_cleared:
            self.cleared_s = at_s
        self.first_robots = self.first_robots or robots
        subject = set(revision.subject_robots)
        self.is_changed |= bool(robots) and len(subject.intersection(robots)) < min(len(subject), 2)

    def pairs(self) -> Iterator[tuple[Pair, TimeSpan]]:
        """Each two of its robots that were listed together, and when: a span each time."""
        for a, b in combinations(sorted(self.listed), 2):
            for of_a, of_b in product(self.listed[a], self.listed[b]):
                together = of_a.within(of_b)
                if together.lasts_s > 0:
                    yield (a, b), together


@dataclass(frozen=True, slots=True)
class SituationTruth:
    """What happened in a log."""

    span_s: float
    """Length of the log."""
    robot_hours: float
    outcomes: Mapping[Pair, PairOutcomes]
    """Of each pair that met or waited."""
    lasting_s: Mapping[Pair, Sequence[float]]
    """By pair, the onsets of its encounters, and of its stops of at least `LONG_STOP_S`."""
    advised: Mapping[Pair, Sequence[TimeSpan]]
    """By pair, the times at which an advisory on a conflict was open."""
    others: Mapping[str, AlertOutcome]
    """By id, what came of advisories of other kinds."""
    waits: AdvisedWaits
    left_s: Callable[[str, float], float]
    """When a robot left after a time, as `Silences.left_s`. At the end of the log every robot leaves."""


class JudgedSituation(NamedTuple):
    """One situation, and what came of it."""

    case: SituationCase
    open_s: float
    """How long it was open, in the log."""
    verdict: Verdict
    came_s: float = nan
    """When its first event began, see `_came`; nan if there was none."""


class SituationScores:
    """The situations of a log."""

    def __init__(self) -> None:
        self._cases: dict[str, SituationCase] = {}
        self._open: set[str] = set()
        self._seconds: Counter[int] = Counter()
        """Seconds of the log, by the number of situations that were open."""
        self._second: int | None = None
        self._last_s = -inf

    def add(self, now_s: float, revisions: Iterable[Situation]) -> None:
        """Add the revisions of a pass."""
        for revision in revisions:
            case = self._cases.get(revision.id)
            if case is None:
                case = SituationCase(revision.situation_kind, revision.raised_at.timestamp())
                self._cases[revision.id] = case
            case.add(revision)
            (self._open.discard if revision.state is AdvisoryState.CLEARED else self._open.add)(revision.id)
        self._last_s = now_s
        if floor(now_s) != self._second:
            self._second = floor(now_s)
            self._seconds[len(self._open)] += 1

    def figures(self, truth: SituationTruth) -> dict[str, Any]:
        """All figures. A share of no cases is None."""
        judged = [self._judged(case, truth) for case in self._cases.values()]
        kinds = counted((name, case.kind) for name, case in self._cases.items())
        fresh_stops = sum(len(outcomes.stops_s) for outcomes in truth.outcomes.values())
        foreseen = self._foreseen(truth)
        early = foreseen[foreseen[:, 1] > 0]
        return {
            **_counts(judged, kinds.total()),
            "again_60_s": self._again(),
            "per_hour": _per(len(judged), truth.span_s / 3600),
            "per_robot_hour": _per(len(judged), truth.robot_hours),
            "fresh_stops": fresh_stops,
            "per_fresh_stop": _per(len(judged), fresh_stops),
            "open_at_once": self._open_at_once(),
            "foreseen": {"outcomes": len(foreseen), "covered": mean(foreseen[:, 0])},
            "foreseen_3_s": {"outcomes": len(early), "covered": mean(early[:, 0])},
            "intervals": {
                **{name: interval(values, means) for name, values in _shares(judged).items()},
                "covered": interval(foreseen[:, 0], means),
                "covered_3_s": interval(early[:, 0], means),
            },
            "by_kind": [
                {"kind": kind, **_counts([each for each in judged if each.case.kind == kind], count)}
                for kind, count in sorted(kinds.items())
            ],
            "cases": {
                "came_true": letters(_shares(judged)["came_true"]),
                "covered": letters(foreseen[:, 0]),
            },
        }

    def _judged(self, case: SituationCase, truth: SituationTruth) -> JudgedSituation:
        return JudgedSituation(case, min(case.cleared_s, self._last_s) - case.raised_s, *_came(case, truth))

    def _again(self) -> int:
        """How many began with the kind and robots of one that had ended less than `AGAIN_S` before."""
        times, ended_s = 0, dict[tuple[str, tuple[str, ...]], float]()
        for case in sorted(self._cases.values(), key=lambda case: case.raised_s):
            subject = case.kind, case.first_robots
            times += case.raised_s - ended_s.get(subject, -inf) < AGAIN_S
            ended_s[subject] = case.cleared_s
        return times

    def _open_at_once(self) -> dict[str, int | None]:
        """The number of open situations over the seconds of the log: median, 95 % quantile and most."""
        counts = sorted(self._seconds)
        reached = np.cumsum([self._seconds[count] for count in counts])
        total = self._seconds.total()
        quantiles = {"median": 0.5, "p95": 0.95, "most": 1.0}
        return {
            name: counts[int(np.searchsorted(reached, share * total))] if total else None
            for name, share in quantiles.items()
        }

    def _foreseen(self, truth: SituationTruth) -> Floats:
        """(n, 2) of each lasting outcome at whose onset an advisory of its pair was open: whether a situation listed
        both robots then, and whether an advisory was raised at least `AHEAD_S` before."""
        listed: dict[Pair, list[TimeSpan]] = {pair: [] for pair in truth.lasting_s}
        for case in self._cases.values():
            for pair, together in case.pairs():
                if pair in listed:
                    listed[pair].append(together)
        rows = []
        for pair, onsets_s in truth.lasting_s.items():
            for onset_s in onsets_s:
                open_since_s = [
                    span.from_s for span in truth.advised.get(pair, ()) if span.from_s <= onset_s < span.to_s
                ]
                if open_since_s:
                    is_covered = any(span.from_s <= onset_s <= span.to_s for span in listed[pair])
                    rows.append((is_covered, min(open_since_s) <= onset_s - AHEAD_S))
        return np.array(rows, np.float64).reshape(-1, 2)


def _came(case: SituationCase, truth: SituationTruth) -> tuple[Verdict, float]:
    """What came of a situation, and when its first event after it was raised began; before that if there is no other,
    nan if there was none."""
    pairs = [(truth.outcomes.get(pair, NOTHING), together) for pair, together in case.pairs()]
    others = [truth.others[advisory] for advisory in case.advisories if advisory in truth.others]
    onsets_s = [other.came_s for other in others if isfinite(other.came_s)]
    for outcomes, together in pairs:
        until_s = together.to_s + WITHIN_S
        onsets_s += [span.onset_s for span in outcomes.spans if together.from_s <= span.onset_s <= until_s]
    if onsets_s:
        return Verdict.TRUE, min([onset_s for onset_s in onsets_s if onset_s >= case.raised_s] or onsets_s)
    if any(_is_any_within(outcomes.spans, together) for outcomes, together in pairs):
        return Verdict.IN_PROGRESS, nan
    is_deadlock = case.kind == "deadlock"
    if truth.waits.began_s(tuple(case.listed), case.raised_s, case.cleared_s, is_deadlock=is_deadlock) < inf:
        return Verdict.HEEDED, nan
    is_doubted = any(_is_any_within(outcomes.doubted, together) for outcomes, together in pairs)
    stays = [(robot, span) for robot, spans in case.listed.items() for span in spans]
    has_left = any(truth.left_s(robot, span.from_s) < span.to_s + WITHIN_S for robot, span in stays)
    is_unknown = is_doubted or has_left or not all(other.known for other in others)
    return Verdict.UNKNOWN if is_unknown else Verdict.KEPT_APART, nan


def _is_any_within(spans: Sequence[OutcomeSpan], together: TimeSpan) -> bool:
    """Whether any of the spans has a moment in `together` or in the `WITHIN_S` after it."""
    return any(span.onset_s <= together.to_s + WITHIN_S and span.end_s >= together.from_s for span in spans)


def _counts(judged: Sequence[JudgedSituation], count: int) -> dict[str, Any]:
    verdicts = Counter(each.verdict for each in judged)
    leads_s = np.array([each.came_s - each.case.raised_s for each in judged])
    open_s = np.array([each.open_s for each in judged])
    cleared_s = [each.open_s for each in judged if each.case.cleared_s < inf]
    return {
        "situations": count,
        "true": verdicts[Verdict.TRUE],
        "in_vain": verdicts[Verdict.KEPT_APART],
        "heeded": verdicts[Verdict.HEEDED],
        "unknown": verdicts[Verdict.UNKNOWN],
        "in_progress": verdicts[Verdict.IN_PROGRESS],
        "changed_subject": sum(each.case.is_changed for each in judged),
        "not_cleared": len(judged) - len(cleared_s),
        **{name: mean(values) for name, values in _shares(judged).items()},
        "lead_time_s": spread(leads_s),
        "open_s": {
            "median": median(open_s),
            "shortest": min(cleared_s, default=None),
            "longest": max(open_s.tolist(), default=None),
        },
        "most_robots": max((len(each.case.listed) for each in judged), default=None),
    }


def _shares(judged: Sequence[JudgedSituation]) -> dict[str, Floats]:
    """By figure, (n,) 1 if it holds for a situation, else 0; nan if it is not judged. What came true is a share of what
    did or was in vain, as of warnings."""
    verdicts = [each.verdict for each in judged]
    not_known = (Verdict.UNKNOWN, Verdict.IN_PROGRESS)
    of_share = {
        "came_true": ((Verdict.TRUE,), (*not_known, Verdict.HEEDED)),
        "prevented": ((Verdict.HEEDED,), not_known),
        "came_true_or_prevented": ((Verdict.TRUE, Verdict.HEEDED), not_known),
    }
    return {
        name: np.array([nan if verdict in left_out else float(verdict in counted) for verdict in verdicts], np.float64)
        for name, (counted, left_out) in of_share.items()
    }


def _per(count: int, whole: float) -> float | None:
    return count / whole if whole else None
