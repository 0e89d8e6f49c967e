"""The figures of judged cases, each with its number of cases and the middle 95 % of draws with replacement."""

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.planned_floors.cases import LEADS_S, Cases, Verdict
from ingest.seam import Floats
from metrics.bootstrap import interval

Figure = dict[str, Any]
"""`value` (None where it can't be told), `of` so many cases, `interval` or None."""


def figures(cases: Cases) -> dict[str, Figure]:
    """All figures by name, in the order in which they are printed."""
    robot_hours = cases.minutes[:, 2].sum() / 3600
    told = {
        f"{what} {how}": _share(rows[:, column])
        for what, rows in (("stops", cases.stops), ("encounters", cases.encounters), ("silent", cases.silent))
        for column, how in enumerate([*(f"told {lead_s:g} s" for lead_s in LEADS_S), "any alert"])
    }
    return {
        **told,
        "passes alerted": _share(cases.passes[:, 0]),
        "alerts true": _figure(cases.verdicts, _share_true, _judged(cases.verdicts)),
        "alert seconds true": _figure(cases.seconds, _seconds_true, int(cases.seconds[:, : Verdict.UNKNOWN].sum())),
        "alerts unknown": _share(cases.verdicts[:, 0] == Verdict.UNKNOWN),
        "alerts in progress": _share(cases.verdicts[:, 0] == Verdict.IN_PROGRESS),
        "alerts on gone": _share(cases.gone[:, 0]),
        "alerts per robot-hour": _figure(cases.minutes, lambda rows: _rate(rows, 0, 3600.0), len(cases.verdicts)),
        "alert minutes per robot-hour": _figure(cases.minutes, lambda rows: _rate(rows, 1, 60.0), len(cases.verdicts)),
        "robot-hours": {"value": robot_hours, "of": len(cases.minutes), "interval": None},
    }


def _figure(rows: Floats, figure: Callable[[Floats], Floats], count: int) -> Figure:
    """A figure over cases; `figure` takes draws (d, n, columns) and gives (d,)."""
    if not len(rows):
        return {"value": None, "of": 0, "interval": None}
    value = float(figure(rows[None])[0])
    return {"value": None if np.isnan(value) else value, "of": count, "interval": interval(rows, figure)}


def _share(hits: Floats) -> Figure:
    rows = np.asarray(hits, np.float64)[:, None]
    return _figure(rows, lambda draws: draws[:, :, 0].mean(axis=1), len(rows))


def _share_true(verdicts: Floats) -> Floats:
    true = (verdicts[:, :, 0] == Verdict.TRUE).sum(axis=1)
    return _ratio(true, true + (verdicts[:, :, 0] == Verdict.IN_VAIN).sum(axis=1))


def _judged(verdicts: Floats) -> int:
    return int(np.isin(verdicts, (Verdict.TRUE, Verdict.IN_VAIN)).sum())


def _seconds_true(seconds: Floats) -> Floats:
    in_all = seconds.sum(axis=1)
    return _ratio(in_all[:, Verdict.TRUE], in_all[:, Verdict.TRUE] + in_all[:, Verdict.IN_VAIN])


def _rate(minutes: Floats, column: int, factor: float) -> Floats:
    in_all = minutes.sum(axis=1)
    return factor * _ratio(in_all[:, column], in_all[:, 2])


def _ratio(over: Floats, under: Floats) -> Floats:
    ratio: Floats = np.divide(over, under, out=np.full(len(under), np.nan), where=under > 0)
    return ratio
