"""How well advisories foresaw what happened. Terms: encounters are those of `metrics/truth.py`.

An alert is one advisory of one pair, from raised to cleared, looked at in whole seconds; seconds at which the pair is
already in an encounter are left out, and an alert without any other second is not scored.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np

from metrics.truth import Encounter, Pair

HORIZON_S = 10.0
STANDING_S = 2.0
"""An encounter is recalled where an alert stood during this long before its start."""


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


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one alert: `True` for a true one, `None` for one that can't be told."""

    alert: Alert
    true: bool | None


def score(encounters: Sequence[Encounter], alerts: Sequence[Alert], clearance_m: float) -> dict[str, Any]:
    """The figures of one clearance; a share over nothing is None."""
    by_pair: dict[Pair, list[Encounter]] = {}
    for one in encounters:
        by_pair.setdefault(one.pair, []).append(one)
    alerts_of: dict[Pair, list[Alert]] = {}
    for alert in alerts:
        alerts_of.setdefault(alert.pair, []).append(alert)
    foreseeable = [one for one in encounters if one.foreseeable]
    stood = [_standing(one, alerts_of.get(one.pair, []), STANDING_S) for one in foreseeable]
    outcomes = [_outcome(alert, by_pair.get(alert.pair, [])) for alert in alerts]
    scored = [one for one in outcomes if one is not None]
    told = [one for one in scored if one.true is not None]
    met = [(one, alert) for one, alert in zip(foreseeable, stood, strict=True) if alert]
    leads = [one.start_s - ceil(alert.raised_s) for one, alert in met]
    return {
        "clearance_m": clearance_m,
        "encounters": len(encounters),
        "foreseeable": len(foreseeable),
        "recall": _share(len(met), len(foreseeable)),
        "recall_any": _share(
            sum(_standing(one, alerts_of.get(one.pair, []), HORIZON_S) is not None for one in foreseeable),
            len(foreseeable),
        ),
        "alerts": len(told),
        "censored": len(scored) - len(told),
        "precision": _share(sum(one.true is True for one in told), len(told)),
        "lead_time_s": _spread(leads),
        "start_error_s": _median([abs(alert.predicted_s - one.start_s) for one, alert in met]),
    }


def _standing(encounter: Encounter, alerts: Sequence[Alert], before_s: float) -> Alert | None:
    """The earliest alert that stood in the last `before_s` before the encounter's start."""
    start_s = encounter.start_s
    standing = [one for one in alerts if one.raised_s < start_s and one.cleared_s > start_s - before_s]
    return min(standing, key=lambda one: one.raised_s, default=None)


def _outcome(alert: Alert, encounters: Sequence[Encounter]) -> Outcome | None:
    """None for an alert that has no second outside an encounter."""
    end_s = min(alert.cleared_s, alert.left_s + HORIZON_S)
    seconds = np.arange(ceil(alert.raised_s), max(ceil(end_s), ceil(alert.raised_s) + 1), dtype=np.float64)
    for one in encounters:
        seconds = seconds[(seconds < one.start_s) | (seconds > one.end_s)]
    if not len(seconds):
        return None
    followed = any(bool(np.any((one.start_s >= seconds) & (one.start_s <= seconds + HORIZON_S))) for one in encounters)
    if followed:
        return Outcome(alert, True)
    return Outcome(alert, None if alert.left_s < alert.predicted_s else False)


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None


def _spread(values: Sequence[float]) -> dict[str, float] | None:
    if not values:
        return None
    p10, median, p90 = np.percentile(values, (10, 50, 90))
    return {"median": float(median), "p10": float(p10), "p90": float(p90)}
