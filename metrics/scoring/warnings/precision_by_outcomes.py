"""Precision of warnings, and the share of events with a warning, from the outcomes of each pair.

The terms are those of `metrics/truth/pair_outcomes.py`. The same figures are computed for the service and for the path
believer.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations_with_replacement
from math import floor
from typing import Any

import numpy as np

from ingest.batch import Floats
from metrics.scoring.bootstrap import interval
from metrics.scoring.summaries import letters, mean, means, medians, ratio, ratios, spread, tenths
from metrics.scoring.warnings.calibration_scores import Vendors
from metrics.scoring.warnings.judged_alerts import LEADS_S, JudgedAlert, JudgedCases, JudgedOnset
from metrics.scoring.warnings.precision_by_encounters import RobotPresence
from metrics.truth.pair_outcomes import IN_VAIN, Verdict
from metrics.truth.silences import MINUTE_S

WARNED_NAMES = (*(f"told_{lead_s:g}_s" for lead_s in LEADS_S), "told_at_any_time")
"""The name in the result of each item of `JudgedOnset.warned`."""
HOUR_S = 3600.0


def figures(cases: JudgedCases, robots: RobotPresence, by_minute_s: Mapping[int, float]) -> dict[str, Any]:
    """The figures of all cases with intervals, by class of encounter and by pair of vendors. A share of no cases is
    None.

    `by_minute_s` is the total presence of robots, by minute since the epoch.
    """
    kinds = sorted({case.alert.encounter_class for case in cases.alerts})
    of_kinds = ((kind, [case for case in cases.alerts if case.alert.encounter_class == kind]) for kind in kinds)
    return {
        **_figures(cases, robots.hours()),
        "intervals": _intervals(cases, by_minute_s),
        "by_class": [{"encounter_class": kind, **_counts(alerts)} for kind, alerts in of_kinds],
        "by_vendor": list(_by_vendor(cases, robots)),
        "by_vendor_pair": list(_by_vendor_pair(cases, robots)),
        "cases": _listed(cases),
    }


def _figures(cases: JudgedCases, robot_hours: float) -> dict[str, Any]:
    stood_s = sum(case.stood_s for case in cases.alerts)
    return {
        **_counts(cases.alerts),
        "robot_hours": robot_hours,
        "alerts_per_robot_hour": len(cases.alerts) / robot_hours if robot_hours else None,
        "alert_minutes_per_robot_hour": stood_s / 60 / robot_hours if robot_hours else None,
        "stops": _warned_shares(_stops(cases)),
        "encounters": _warned_shares(_encounters(cases)),
        "ahead_by_s": spread(_ahead_s(cases.onsets)),
    }


def _counts(alerts: Sequence[JudgedAlert]) -> dict[str, Any]:
    """Counts of alerts by verdict, and of the whole seconds at which they were open."""
    found, seconds = Counter(case.verdict for case in alerts), _seconds(alerts)
    return {
        "alerts": len(alerts),
        "true": found[Verdict.TRUE],
        "in_vain": sum(found[verdict] for verdict in IN_VAIN),
        "ordered": found[Verdict.ORDERED],
        "repeated": found[Verdict.REPEATED],
        "heeded": found[Verdict.HEEDED],
        "unknown": found[Verdict.UNKNOWN],
        "in_progress": found[Verdict.IN_PROGRESS],
        "precision": mean(came_true(alerts)),
        "seconds_judged": int(seconds[:, 1].sum()),
        "seconds_true": ratio(seconds),
    }


def _warned_shares(onsets: Sequence[JudgedOnset]) -> dict[str, Any]:
    rows = _warned_rows(onsets)
    return {"fresh": len(onsets), **{name: mean(rows[:, column]) for column, name in enumerate(WARNED_NAMES)}}


def _by_vendor(cases: JudgedCases, robots: RobotPresence) -> Iterator[dict[str, Any]]:
    """Of each vendor, the cases with one of its robots. Those of two vendors are in both."""
    for name in sorted(set(robots.vendor_of.values())):
        alerts = [alert for alert in cases.alerts if name in alert.vendors]
        onsets = [onset for onset in cases.onsets if name in onset.vendors]
        yield {"vendor": name, **_figures(JudgedCases(alerts, onsets), robots.hours([name]))}


def _by_vendor_pair(cases: JudgedCases, robots: RobotPresence) -> Iterator[dict[str, Any]]:
    parts: dict[Vendors, JudgedCases] = {}
    for alert in cases.alerts:
        parts.setdefault(alert.vendors, JudgedCases([], [])).alerts.append(alert)
    for onset in cases.onsets:
        parts.setdefault(onset.vendors, JudgedCases([], [])).onsets.append(onset)
    names = sorted(set(robots.vendor_of.values()))
    for pair in combinations_with_replacement(names, 2):
        if pair in parts:
            yield {"vendors": list(pair), **_figures(parts[pair], robots.hours(pair))}


def _intervals(cases: JudgedCases, by_minute_s: Mapping[int, float]) -> dict[str, Any]:
    """Bootstrap intervals of each figure over alerts, onsets or minutes."""
    minutes = _minutes(cases, by_minute_s)
    warned = {"stops": _warned_rows(_stops(cases)), "encounters": _warned_rows(_encounters(cases))}
    return {
        "precision": interval(came_true(cases.alerts), means),
        "seconds_true": interval(_seconds(cases.alerts), ratios),
        "alerts_per_robot_hour": interval(minutes[:, [0, 2]], ratios),
        "alert_minutes_per_robot_hour": interval(minutes[:, [1, 2]], ratios),
        "warned_of": interval(_warned_rows(cases.onsets)[:, -1], means),
        "ahead_by_s": interval(_ahead_s(cases.onsets), medians),
        **{
            what: {name: interval(rows[:, column], means) for column, name in enumerate(WARNED_NAMES)}
            for what, rows in warned.items()
        },
    }


def _listed(cases: JudgedCases) -> dict[str, Any]:
    """Every case in short form for comparisons: one letter each, ordered by start."""
    stops, encounters = _warned_rows(_stops(cases)), _warned_rows(_encounters(cases))
    return {
        "came_true": letters(came_true(cases.alerts)),
        "warned_of": letters(_warned_rows(cases.onsets)[:, -1]),
        "warned_of_2_s": letters(_warned_rows(cases.onsets)[:, 0]),
        "ahead_by_s": tenths(_ahead_s(cases.onsets)),
        **{f"stops_{name}": letters(stops[:, column]) for column, name in enumerate(WARNED_NAMES)},
        **{f"encounters_{name}": letters(encounters[:, column]) for column, name in enumerate(WARNED_NAMES)},
    }


def _stops(cases: JudgedCases) -> list[JudgedOnset]:
    return [case for case in cases.onsets if case.is_stop]


def _encounters(cases: JudgedCases) -> list[JudgedOnset]:
    return [case for case in cases.onsets if not case.is_stop]


def came_true(alerts: Sequence[JudgedAlert]) -> Floats:
    """(n,) 1 for a true alert, 0 for one in vain, nan if the outcome is unknown."""
    value_of = {Verdict.TRUE: 1.0} | dict.fromkeys(IN_VAIN, 0.0)
    return np.array([value_of.get(case.verdict, np.nan) for case in alerts], np.float64)


def _seconds(alerts: Sequence[JudgedAlert]) -> Floats:
    """(n, 2) of each alert: the number of whole seconds that were true, and of those that were true or in vain."""
    counts = np.array([case.seconds for case in alerts], np.float64).reshape(-1, len(Verdict))
    true = counts[:, Verdict.TRUE]
    return np.stack([true, true + counts[:, list(IN_VAIN)].sum(axis=1)], axis=1)


def _ahead_s(onsets: Sequence[JudgedOnset]) -> Floats:
    """(n,) how far ahead each onset was warned of, nan if it was not."""
    return np.array([onset.ahead_s for onset in onsets], np.float64)


def _warned_rows(onsets: Sequence[JudgedOnset]) -> Floats:
    """(n, WARNED_NAMES) 1 if an alert preceded the onset, else 0."""
    return np.array([onset.warned for onset in onsets], np.float64).reshape(-1, len(WARNED_NAMES))


def _minutes(cases: JudgedCases, by_minute_s: Mapping[int, float]) -> Floats:
    """(m, 3) of each minute: the alerts raised in it, the minutes for which these were open, and the robot-hours."""
    minutes = sorted(by_minute_s)
    rows = np.zeros((len(minutes), 3))
    rows[:, 2] = [by_minute_s[minute] / HOUR_S for minute in minutes]
    for case in cases.alerts if minutes else ():
        row = bisect_left(minutes, floor(case.alert.raised_s / MINUTE_S))
        rows[min(row, len(minutes) - 1), :2] += 1.0, case.stood_s / 60
    return rows
