"""All figures of judged cases, by name."""

from math import nan

import numpy as np

from benchmarks.planned_floors.scoring.calibration import calibration
from benchmarks.planned_floors.scoring.figure import Figure, alone, of_cases, ratio, share
from benchmarks.planned_floors.scoring.judged_cases import LEADS_S, Cases, Verdict
from ingest.batch import Floats


def figures(cases: Cases) -> dict[str, Figure]:
    """All figures in the order in which they are printed."""
    verdicts, alerts = cases.verdicts[:, 0], len(cases.verdicts)
    warned = {
        f"{what} {how}": share(rows[:, column])
        for what, rows in (
            ("stops", cases.stops),
            ("encounters", cases.encounters),
            ("outcomes", cases.outcomes),
            ("silent", cases.silent),
            ("silent standing", cases.standing),
        )
        for column, how in enumerate([*(f"told {lead_s:g} s" for lead_s in LEADS_S), "any alert"])
    }
    judged = int(np.isin(verdicts, (Verdict.TRUE, Verdict.IN_VAIN)).sum())
    return {
        **warned,
        "silent seconds there": _mean(cases.silent_seconds[:, 0]),
        "silent seconds standing": _mean(cases.silent_seconds[:, 1]),
        "passes alerted": share(cases.passes[:, 0]),
        "alerts true": of_cases(cases.verdicts, _share_true, judged),
        "alert seconds true": of_cases(cases.seconds, _seconds_true, int(cases.seconds[:, : Verdict.UNKNOWN].sum())),
        "alerts unknown": share(verdicts == Verdict.UNKNOWN),
        "alerts in progress": share(verdicts == Verdict.IN_PROGRESS),
        "alerts on gone": share(cases.gone[:, 0]),
        "alerts per robot-hour": of_cases(cases.minutes, _alerts_per_hour, alerts),
        "alert minutes per robot-hour": of_cases(cases.minutes, _minutes_per_hour, alerts),
        **calibration(cases),
        "robot-hours": alone(float(cases.minutes[:, 2].sum()) / 3600, len(cases.minutes)),
    }


def _mean(hits: Floats) -> Figure:
    """A share without an interval, because the seconds of one silence are not independent."""
    return alone(float(hits.mean()) if len(hits) else nan, len(hits))


def _share_true(verdicts: Floats) -> Floats:
    true = (verdicts[:, :, 0] == Verdict.TRUE).sum(axis=1)
    return ratio(true, true + (verdicts[:, :, 0] == Verdict.IN_VAIN).sum(axis=1))


def _seconds_true(seconds: Floats) -> Floats:
    in_all = seconds.sum(axis=1)
    return ratio(in_all[:, Verdict.TRUE], in_all[:, Verdict.TRUE] + in_all[:, Verdict.IN_VAIN])


def _alerts_per_hour(minutes: Floats) -> Floats:
    in_all = minutes.sum(axis=1)
    return 3600 * ratio(in_all[:, 0], in_all[:, 2])


def _minutes_per_hour(minutes: Floats) -> Floats:
    in_all = minutes.sum(axis=1)
    return 60 * ratio(in_all[:, 1], in_all[:, 2])
