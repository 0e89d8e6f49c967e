"""How well advisories foresaw what happened. Terms: encounters are those of `metrics/truth/encounters.py`.

An alert is one advisory of one pair, from raised to cleared, looked at in whole seconds, which recall, lead time and
precision all rest on. Seconds at which the pair is already in an encounter are left out, and those after a robot left,
which no encounter can follow. An alert without any other second is not scored and recalls nothing.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations_with_replacement
from math import ceil, isnan, nan
from typing import Any

import numpy as np

from ingest.batch import Floats, Pair
from metrics.scoring.bootstrap import interval
from metrics.scoring.summaries import mean, means, median, medians, spread
from metrics.scoring.warnings.calibration_scores import CalibrationTally, Vendors
from metrics.truth.encounters import RecordedEncounter

HORIZON_S = 10.0
STANDING_S = 2.0
"""An encounter is recalled where an alert stood at a whole second of so long before its start."""


@dataclass(frozen=True, slots=True)
class Alert:
    """One advisory of one pair."""

    pair: Pair
    vendors: tuple[str, str]
    raised_s: float
    cleared_s: float
    """inf where it was never cleared."""
    predicted_s: float
    """When its last revision before the encounter said that it would start."""
    left_s: float
    """When the first of the two was last heard."""
    place: tuple[str, float, float] | None = None
    """Floor, x and y of where it said that it would start."""
    heeded: bool = False
    """Whether one of the two waited as advised while it stood."""
    encounter_class: str = ""
    """How the two were to meet when it was raised."""


@dataclass(frozen=True, slots=True)
class RobotPresence:
    """Who was on the floor, and for how long."""

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
    """What became of each foreseeable encounter and of each alert, in the order they began."""

    encounters: int
    met: Floats
    """(n, 4) for each foreseeable one: recalled, recalled at any time (1 or 0), lead time and start error in seconds,
    nan where no alert stood."""
    alerts: Floats
    """(m,) 1 for one that came true, 0 for a nuisance, nan for one that can't be told."""
    places: list[tuple[str, float, float] | None] = field(default_factory=list)
    """(m,) of the alerts."""
    tally: CalibrationTally = field(default_factory=CalibrationTally)
    heeded: int = 0
    """Alerts that can't be told since a robot waited as advised."""


_MEASURED = {"recall": means, "recall_any": means, "lead_time_s": medians, "start_error_s": medians}
"""What each column of `AlertCases.met` comes to."""


def score(
    encounters: Sequence[RecordedEncounter],
    alerts: Sequence[Alert],
    clearance_m: float,
    presence: RobotPresence | None = None,
    tallies: Mapping[Vendors, CalibrationTally] | None = None,
) -> dict[str, Any]:
    """The figures of one clearance, in all, by vendor and by pair of vendors; a share over nothing is None.

    `tallies` are those of the probabilities, by pair of vendors in ascending order.
    """
    there = presence or RobotPresence()
    by_vendors = _split(encounters, alerts, there)
    for vendors, tally in (tallies or {}).items():
        by_vendors.setdefault(vendors, _cases([], [])).tally = tally
    whole = _cases(encounters, alerts)
    whole.tally = CalibrationTally.joined((tallies or {}).values())
    names = sorted(set(there.vendor_of.values()))
    return {
        "clearance_m": clearance_m,
        **_figures(whole, there.hours()),
        "intervals": _intervals(whole),
        "by_vendor": [{"vendor": name, **_figures(_joined(by_vendors, [name]), there.hours([name]))} for name in names],
        "by_vendor_pair": [
            {"vendors": list(pair), **_figures(by_vendors[pair], there.hours(pair))}
            for pair in combinations_with_replacement(names, 2)
            if pair in by_vendors
        ],
        "cases": _listed(whole),
    }


def _split(
    encounters: Sequence[RecordedEncounter], alerts: Sequence[Alert], there: RobotPresence
) -> dict[Vendors, AlertCases]:
    """The cases of each pair of vendors."""
    parts: dict[Vendors, tuple[list[RecordedEncounter], list[Alert]]] = {}
    for one in encounters:
        parts.setdefault(there.vendors(one.pair), ([], []))[0].append(one)
    for alert in alerts:
        parts.setdefault(there.vendors(alert.pair), ([], []))[1].append(alert)
    return {vendors: _cases(*part) for vendors, part in parts.items()}


def _joined(by_vendors: Mapping[Vendors, AlertCases], names: Sequence[str]) -> AlertCases:
    """The cases in which a robot of any of these vendors took part."""
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
    by_pair: dict[Pair, list[RecordedEncounter]] = {}
    for one in encounters:
        by_pair.setdefault(one.pair, []).append(one)
    ordered = [
        (alert, _seconds(alert, by_pair.get(alert.pair, [])))
        for alert in sorted(alerts, key=lambda alert: (alert.raised_s, alert.pair))
    ]
    stood = [(alert, seconds) for alert, seconds in ordered if len(seconds)]
    stood_of: dict[Pair, list[tuple[Alert, Floats]]] = {}
    for alert, seconds in stood:
        stood_of.setdefault(alert.pair, []).append((alert, seconds[seconds < alert.cleared_s]))
    met = [_met(one, stood_of.get(one.pair, [])) for one in encounters if one.foreseeable]
    scored = [(alert, _outcome(alert, seconds, by_pair.get(alert.pair, []))) for alert, seconds in stood]
    return AlertCases(
        len(encounters),
        np.array(met, np.float64).reshape(-1, 4),
        np.array([outcome for _, outcome in scored], np.float64),
        [one.place for one, _ in scored],
        heeded=sum(one.heeded and isnan(outcome) for one, outcome in scored),
    )


def _met(encounter: RecordedEncounter, stood: Sequence[tuple[Alert, Floats]]) -> tuple[float, float, float, float]:
    """A row of `AlertCases.met`, from the alerts of its pair and the whole seconds at which each stood."""
    start_s = encounter.start_s
    at_any_time = float(any(_standing(seconds, start_s, HORIZON_S) for _, seconds in stood))
    for alert, seconds in stood:
        if _standing(seconds, start_s, STANDING_S):
            return 1.0, at_any_time, start_s - float(seconds[0]), abs(alert.predicted_s - start_s)
    return 0.0, at_any_time, nan, nan


def _figures(cases: AlertCases, robot_hours: float) -> dict[str, Any]:
    told = cases.alerts[~np.isnan(cases.alerts)]
    precision = mean(told)
    return {
        "encounters": cases.encounters,
        "foreseeable": len(cases.met),
        "recall": mean(cases.met[:, 0]),
        "recall_any": mean(cases.met[:, 1]),
        "alerts": len(told),
        "censored": len(cases.alerts) - len(told) - cases.heeded,
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
    """The middle 95 % of each figure over encounters, alerts or groups of pairs drawn again."""
    told = cases.alerts[~np.isnan(cases.alerts)]
    return {
        **{name: interval(cases.met[:, n], figures) for n, (name, figures) in enumerate(_MEASURED.items())},
        "precision": interval(told, means),
        **cases.tally.intervals(),
    }


def _listed(cases: AlertCases) -> dict[str, Any]:
    """Every case in short, for comparisons: a letter or a number each, in the order they began."""
    return {
        "recalled": "".join("ny"[int(value)] for value in cases.met[:, 0]),
        "recalled_any": "".join("ny"[int(value)] for value in cases.met[:, 1]),
        "lead_time_s": " ".join("-" if np.isnan(value) else f"{value:.1f}" for value in cases.met[:, 2]),
        "start_error_s": " ".join("-" if np.isnan(value) else f"{value:.1f}" for value in cases.met[:, 3]),
        "came_true": "".join("-" if np.isnan(value) else "ny"[int(value)] for value in cases.alerts),
        "places": _placed(cases.places),
        "probabilities": [[round(value, 6) for value in row] for row in cases.tally.every_group().tolist()],
    }


def _placed(places: Sequence[tuple[str, float, float] | None]) -> list[str]:
    """The alerts' places in that order: `x y floor`, or empty."""
    return ["" if one is None else f"{one[1]:.1f} {one[2]:.1f} {one[0]}" for one in places]


def _seconds(alert: Alert, encounters: Sequence[RecordedEncounter]) -> Floats:
    """(s,) the whole seconds at which an alert stood outside of its pair's encounters; one that was cleared before a
    whole second came is judged at that."""
    first, end_s = ceil(alert.raised_s), min(alert.cleared_s, alert.left_s)
    seconds = np.arange(first, max(ceil(end_s), first + 1), dtype=np.float64)
    for one in encounters:
        seconds = seconds[(seconds < one.start_s) | (seconds > one.end_s)]
    return seconds


def _standing(seconds: Floats, start_s: float, before_s: float) -> bool:
    """Whether any of the seconds lies in the last `before_s` before a start."""
    return bool(np.any((seconds < start_s) & (seconds >= start_s - before_s)))


def _outcome(alert: Alert, seconds: Floats, encounters: Sequence[RecordedEncounter]) -> float:
    """1 for a true alert, 0 for a nuisance, nan for one that can't be told; it stood at whole seconds (s,)."""
    if any(_standing(seconds, one.start_s, HORIZON_S) for one in encounters):
        return 1.0
    return nan if alert.heeded or alert.left_s < alert.predicted_s else 0.0
