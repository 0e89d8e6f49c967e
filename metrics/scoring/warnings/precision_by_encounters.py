"""Recall, precision and lead time of advisories. Encounters are those of `metrics/truth/encounters.py`.

An alert is one advisory of one pair, from raised to cleared. It is examined at whole seconds; recall, lead time and
precision all use these. Seconds at which the pair is already in an encounter are excluded, and so are seconds after a
robot left, because no encounter can follow them. An alert without any other second is not scored and recalls nothing.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations_with_replacement
from math import ceil, inf, isnan, nan
from typing import Any

import numpy as np

from ingest.batch import Floats, Ints, Pair
from metrics.scoring.bootstrap import interval
from metrics.scoring.summaries import letters, mean, means, median, medians, spread, tenths
from metrics.scoring.warnings.calibration_scores import CalibrationTally, Vendors
from metrics.scoring.warnings.outcomes_by_moment import HORIZON_S
from metrics.truth.encounters import RecordedEncounter

STANDING_S = 2.0
"""An encounter is recalled if an alert was open at a whole second within this time before its start."""


@dataclass(frozen=True, slots=True)
class Alert:
    """One advisory of one pair."""

    pair: Pair
    vendors: tuple[str, str]
    raised_s: float
    cleared_s: float
    """inf if it was never cleared."""
    predicted_s: float
    """Predicted start of the encounter, of the last revision before that start."""
    left_s: float
    """The time of the last report of the robot that left first."""
    place: tuple[str, float, float] | None = None
    """Floor, x and y of the predicted start."""
    heeded: bool = False
    """Whether one of the two waited as advised while the alert was open."""
    encounter_class: str = ""
    """The class of the predicted encounter when it was raised."""
    advisory: str = ""
    """Id of the advisory."""


@dataclass(frozen=True, slots=True, eq=False)
class PairEncounters:
    """When the encounters of one pair were."""

    start_s: Floats
    """(n + 1,) starts, ascending, and inf."""
    ended_s: Floats
    """(n + 1,) -inf, and the latest end of the first encounter, of the first two, and so on."""

    @classmethod
    def of(cls, encounters: Iterable[RecordedEncounter]) -> "PairEncounters":
        spans_s = sorted((encounter.start_s, encounter.end_s) for encounter in encounters)
        start_s, end_s = np.array([(-inf, -inf), *spans_s, (inf, inf)]).T
        return cls(start_s[1:], np.maximum.accumulate(end_s[:-1]))

    def outside(self, seconds: Floats) -> Floats:
        """The seconds (s,) that are in no encounter."""
        return seconds[seconds > self.ended_s[self._started(seconds)]]

    def is_any_before(self, seconds: Floats) -> bool:
        """Whether any of the seconds (s,) is in the last `HORIZON_S` before an encounter."""
        return bool(np.any(seconds >= self.start_s[self._started(seconds)] - HORIZON_S))

    def _started(self, seconds: Floats) -> Ints:
        """(s,) how many encounters have started by each second."""
        return self.start_s.searchsorted(seconds, "right")


@dataclass(frozen=True, slots=True, eq=False)
class PairAlerts:
    """When the alerts of one pair stood."""

    alerts: Sequence[tuple[float, float]]
    """First whole second, and predicted start, of each alert that stood at any, in the order in which they were
    raised."""
    seconds: Floats
    """(s,) whole seconds at which any of them stood, ascending. A second is repeated for each alert."""
    numbers: Ints
    """(s,) which of the alerts stood then."""

    @classmethod
    def of(cls, alerts: Sequence[tuple[Alert, Floats]]) -> "PairAlerts":
        """From the alerts in the order in which they were raised, and the whole seconds at which each stood."""
        stood = [(alert, seconds) for alert, seconds in alerts if len(seconds)]
        seconds = np.concatenate([np.empty(0), *(seconds for _, seconds in stood)])
        numbers = np.repeat(np.arange(len(stood)), [len(seconds) for _, seconds in stood])
        order = seconds.argsort(kind="stable")
        firsts = [(float(seconds[0]), alert.predicted_s) for alert, seconds in stood]
        return cls(firsts, seconds[order], numbers[order])

    def recall_row(self, start_s: float) -> tuple[float, float, float, float]:
        """A row of `AlertCases.met`, for an encounter of the pair that starts then."""
        horizon, standing, start = self.seconds.searchsorted((start_s - HORIZON_S, start_s - STANDING_S, start_s))
        if standing == start:
            return 0.0, float(horizon < start), nan, nan
        first_s, predicted_s = self.alerts[int(self.numbers[standing:start].min())]
        return 1.0, 1.0, start_s - first_s, abs(predicted_s - start_s)


@dataclass(frozen=True, slots=True)
class RobotPresence:
    """The robots on the floor, and how long each was there."""

    vendor_of: Mapping[str, str] = field(default_factory=dict)
    """By robot."""
    present_s: Mapping[str, float] = field(default_factory=dict)
    """By robot."""

    def vendors(self, pair: Pair) -> Vendors:
        a, b = (self.vendor_of.get(robot, "unknown") for robot in pair)
        return min(a, b), max(a, b)

    def hours(self, vendors: Iterable[str] | None = None) -> float:
        """Robot-hours of these vendors, or of all."""
        counted = None if vendors is None else set(vendors)
        times = (s for robot, s in self.present_s.items() if counted is None or self.vendor_of.get(robot) in counted)
        return sum(times) / 3600


@dataclass(slots=True)
class AlertCases:
    """The outcome of each foreseeable encounter and of each alert, ordered by start."""

    encounters: int
    met: Floats
    """(n, 4) of each foreseeable encounter: recalled, recalled at any time (1 or 0), lead time and start error in
    seconds, nan if no alert was open."""
    alerts: Floats
    """(m,) 1 for a true alert, 0 for a nuisance, nan if the outcome is unknown."""
    places: list[tuple[str, float, float] | None] = field(default_factory=list)
    """(m,) places of the alerts."""
    tally: CalibrationTally = field(default_factory=CalibrationTally)
    heeded: int = 0
    """Alerts whose outcome is unknown because a robot waited as advised."""


_MEASURED = {"recall": means, "recall_any": means, "lead_time_s": medians, "start_error_s": medians}
"""The statistic of each column of `AlertCases.met`."""


def score(
    encounters: Sequence[RecordedEncounter],
    alerts: Sequence[Alert],
    clearance_m: float,
    presence: RobotPresence | None = None,
    tallies: Mapping[Vendors, CalibrationTally] | None = None,
) -> dict[str, Any]:
    """The figures of one clearance: of all pairs, by vendor and by pair of vendors. A share of no cases is None.

    `tallies` are the calibration tallies, by pair of vendors in ascending order.
    """
    robots = presence or RobotPresence()
    by_vendors = _split(encounters, alerts, robots)
    for vendors, tally in (tallies or {}).items():
        by_vendors.setdefault(vendors, _cases([], [])).tally = tally
    whole = _cases(encounters, alerts)
    whole.tally = CalibrationTally.joined((tallies or {}).values())
    names = sorted(set(robots.vendor_of.values()))
    return {
        "clearance_m": clearance_m,
        **_figures(whole, robots.hours()),
        "intervals": _intervals(whole),
        "by_vendor": [
            {"vendor": name, **_figures(_joined(by_vendors, [name]), robots.hours([name]))} for name in names
        ],
        "by_vendor_pair": [
            {"vendors": list(pair), **_figures(by_vendors[pair], robots.hours(pair))}
            for pair in combinations_with_replacement(names, 2)
            if pair in by_vendors
        ],
        "cases": _listed(whole),
    }


def _split(
    encounters: Sequence[RecordedEncounter], alerts: Sequence[Alert], robots: RobotPresence
) -> dict[Vendors, AlertCases]:
    """The cases of each pair of vendors."""
    parts: dict[Vendors, tuple[list[RecordedEncounter], list[Alert]]] = {}
    for encounter in encounters:
        parts.setdefault(robots.vendors(encounter.pair), ([], []))[0].append(encounter)
    for alert in alerts:
        parts.setdefault(robots.vendors(alert.pair), ([], []))[1].append(alert)
    return {vendors: _cases(*part) for vendors, part in parts.items()}


def _joined(by_vendors: Mapping[Vendors, AlertCases], names: Sequence[str]) -> AlertCases:
    """The cases with a robot of any of these vendors."""
    parts = [cases for vendors, cases in by_vendors.items() if not set(vendors).isdisjoint(names)]
    return AlertCases(
        sum(part.encounters for part in parts),
        np.concatenate([np.empty((0, 4)), *(part.met for part in parts)]),
        np.concatenate([np.empty(0), *(part.alerts for part in parts)]),
        [place for part in parts for place in part.places],
        CalibrationTally.joined(part.tally for part in parts),
        sum(part.heeded for part in parts),
    )


def _cases(encounters: Sequence[RecordedEncounter], alerts: Sequence[Alert]) -> AlertCases:
    encounters_of: defaultdict[Pair, list[RecordedEncounter]] = defaultdict(list)
    for encounter in encounters:
        encounters_of[encounter.pair].append(encounter)
    pairs = {encounter.pair for encounter in encounters} | {alert.pair for alert in alerts}
    met = {pair: PairEncounters.of(encounters_of[pair]) for pair in pairs}
    ordered = sorted(alerts, key=lambda alert: (alert.raised_s, alert.pair))
    examined = [(alert, met[alert.pair].outside(_seconds(alert))) for alert in ordered]
    open_alerts = [(alert, seconds) for alert, seconds in examined if len(seconds)]
    open_of: defaultdict[Pair, list[tuple[Alert, Floats]]] = defaultdict(list)
    for alert, seconds in open_alerts:
        open_of[alert.pair].append((alert, seconds[seconds < alert.cleared_s]))
    warned = {pair: PairAlerts.of(open_of[pair]) for pair in pairs}
    rows = [warned[encounter.pair].recall_row(encounter.start_s) for encounter in encounters if encounter.foreseeable]
    scored = [(alert, _outcome(alert, seconds, met[alert.pair])) for alert, seconds in open_alerts]
    return AlertCases(
        len(encounters),
        np.array(rows, np.float64).reshape(-1, 4),
        np.array([outcome for _, outcome in scored], np.float64),
        [alert.place for alert, _ in scored],
        heeded=sum(alert.heeded and isnan(outcome) for alert, outcome in scored),
    )


def _figures(cases: AlertCases, robot_hours: float) -> dict[str, Any]:
    known = cases.alerts[~np.isnan(cases.alerts)]
    precision = mean(known)
    return {
        "encounters": cases.encounters,
        "foreseeable": len(cases.met),
        "recall": mean(cases.met[:, 0]),
        "recall_any": mean(cases.met[:, 1]),
        "alerts": len(known),
        "censored": len(cases.alerts) - len(known) - cases.heeded,
        "heeded": cases.heeded,
        "precision": precision,
        "nuisance_rate": None if precision is None else 1 - precision,
        "robot_hours": robot_hours,
        "alerts_per_robot_hour": len(cases.alerts) / robot_hours if robot_hours else None,
        "lead_time_s": spread(cases.met[:, 2]),
        "start_error_s": median(cases.met[:, 3]),
        **cases.tally.figures(),
    }


def _intervals(cases: AlertCases) -> dict[str, Any]:
    """Bootstrap intervals of each figure over encounters, alerts or groups of pairs."""
    known = cases.alerts[~np.isnan(cases.alerts)]
    return {
        **{name: interval(cases.met[:, n], figures) for n, (name, figures) in enumerate(_MEASURED.items())},
        "precision": interval(known, means),
        **cases.tally.intervals(),
    }


def _listed(cases: AlertCases) -> dict[str, Any]:
    """Every case in short form for comparisons: one letter or number each, ordered by start."""
    return {
        "recalled": letters(cases.met[:, 0]),
        "recalled_any": letters(cases.met[:, 1]),
        "lead_time_s": tenths(cases.met[:, 2]),
        "start_error_s": tenths(cases.met[:, 3]),
        "came_true": letters(cases.alerts),
        "places": placed(cases.places),
        "probabilities": [[round(value, 6) for value in row] for row in cases.tally.every_group().tolist()],
    }


def placed(places: Sequence[tuple[str, float, float] | None]) -> list[str]:
    """The places of the alerts in that order: `x y floor`, or empty."""
    return ["" if place is None else f"{place[1]:.1f} {place[2]:.1f} {place[0]}" for place in places]


def _seconds(alert: Alert) -> Floats:
    """(s,) the whole seconds at which an alert was open. An alert that was cleared before the next whole second is
    examined at that second."""
    first, end_s = ceil(alert.raised_s), min(alert.cleared_s, alert.left_s)
    return np.arange(first, max(ceil(end_s), first + 1), dtype=np.float64)


def _outcome(alert: Alert, seconds: Floats, met: PairEncounters) -> float:
    """1 for a true alert, 0 for a nuisance, nan if unknown. `seconds` (s,) are those at which it was open, `met` are
    the encounters of its pair."""
    if met.is_any_before(seconds):
        return 1.0
    return nan if alert.heeded or alert.left_s < alert.predicted_s else 0.0
