"""Alerts in vain and missed onsets one by one, and the course of a log by minute: for people who look into them."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import floor
from typing import Any

from deconflict_client.participant_kinds import ParticipantKind
from ingest.batch import Pair
from ingest.languages import timestamps
from metrics.scoring.summaries import letters
from metrics.scoring.warnings.judged_alerts import JudgedAlert, JudgedCases, JudgedOnset
from metrics.scoring.warnings.precision_by_encounters import placed
from metrics.scoring.warnings.precision_by_outcomes import came_true
from metrics.truth.pair_outcomes import IN_VAIN, Verdict
from metrics.truth.silences import MINUTE_S

MOST_LISTED = 200
"""Of each list, the first ones."""


@dataclass(slots=True)
class LogNames:
    """Names of the robots and floors of a log."""

    vendor_of: dict[str, str] = field(default_factory=dict)
    """By robot that has reported its position."""
    name_of: dict[str, str] = field(default_factory=dict)
    """Display name of each of these robots."""
    participant_of: dict[str, ParticipantKind] = field(default_factory=dict)
    """What each of these robots stands for."""
    floors: Sequence[str] = ()
    """Floor ids by the index that batches use."""
    floor_names: Mapping[str, str] = field(default_factory=dict)
    """By floor id, of the floors that have a name."""
    first_s: float = 0.0
    """When the log begins."""


def listed(cases: JudgedCases, names: LogNames) -> dict[str, Any]:
    """The first `MOST_LISTED` alerts in vain and onsets without an alert, and how many of each are left out. The place
    of every alert in short form, and as a letter whether it came true."""
    in_vain = [case for case in cases.alerts if case.verdict in IN_VAIN]
    missed = [onset for onset in cases.onsets if not onset.warned[-1]]
    return {
        "in_vain": [_alert(case, names) for case in in_vain[:MOST_LISTED]],
        "in_vain_left_out": max(len(in_vain) - MOST_LISTED, 0),
        "missed": [_onset(onset, names) for onset in missed[:MOST_LISTED]],
        "missed_left_out": max(len(missed) - MOST_LISTED, 0),
        "places": placed([case.alert.place for case in cases.alerts]),
        "came_true": letters(came_true(cases.alerts)),
    }


def by_minute(cases: JudgedCases, by_minute_s: Mapping[int, float]) -> list[dict[str, Any]]:
    """Of each minute since the epoch with robots: how many there were, the alerts raised in it, and the onsets."""
    counts: defaultdict[int, dict[str, int]] = defaultdict(
        lambda: {"true": 0, "in_vain": 0, "other": 0, "warned": 0, "missed": 0}
    )
    for case in cases.alerts:
        outcome = "true" if case.verdict is Verdict.TRUE else "in_vain" if case.verdict in IN_VAIN else "other"
        counts[floor(case.alert.raised_s / MINUTE_S)][outcome] += 1
    for onset in cases.onsets:
        counts[floor(onset.onset_s / MINUTE_S)]["warned" if onset.warned[-1] else "missed"] += 1
    return [
        {"at_s": minute * MINUTE_S, "robots": round(by_minute_s.get(minute, 0.0) / MINUTE_S, 2), **counts[minute]}
        for minute in sorted({*by_minute_s, *counts})
    ]


def _alert(case: JudgedAlert, names: LogNames) -> dict[str, Any]:
    alert = case.alert
    floor_id, x_m, y_m = alert.place or ("", None, None)
    return {
        "advisory": alert.advisory,
        **_moment(alert.pair, alert.raised_s, names),
        "open_s": round(case.stood_s, 1),
        "predicted_in_s": round(max(alert.predicted_s - alert.raised_s, 0.0), 1),
        "encounter_class": alert.encounter_class,
        "verdict": case.verdict.name.lower(),
        **_place(floor_id, x_m, y_m, names),
    }


def _onset(onset: JudgedOnset, names: LogNames) -> dict[str, Any]:
    place = onset.place
    floor_id = names.floors[place.floor] if place and place.floor >= 0 else ""
    return {
        **_moment(onset.pair, onset.onset_s, names),
        "event": "stop" if onset.is_stop else "encounter",
        **_place(floor_id, place and place.x_m, place and place.y_m, names),
    }


def _moment(pair: Pair, at_s: float, names: LogNames) -> dict[str, Any]:
    return {
        "at": timestamps.write(round(at_s, 1)),
        "into_s": round(at_s - names.first_s, 1),
        "robots": list(pair),
        "names": [names.name_of.get(robot, robot) for robot in pair],
        "vendors": [names.vendor_of.get(robot, "unknown") for robot in pair],
    }


def _place(floor_id: str, x_m: float | None, y_m: float | None, names: LogNames) -> dict[str, Any]:
    return {
        "floor": floor_id,
        "floor_name": names.floor_names.get(floor_id, ""),
        "x_m": None if x_m is None else round(x_m, 2),
        "y_m": None if y_m is None else round(y_m, 2),
    }
