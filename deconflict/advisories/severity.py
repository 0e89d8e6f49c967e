"""How severe an advisory is. A conflict: by the time that is left, how close the two come, and how likely it is.
Queues, deadlocks and blockages: by the time that is left. What is never more or less severe, as a claim, has a fixed
severity where its finding is made.

The kernels of `watched_pair_kernels` compile `is_shallow`, `severity_level` and `next_severity_change_s`.
"""

from math import inf

from deconflict.advisories.conflict_predictions import Prediction
from deconflict.advisory import Severity
from deconflict.settings.site import Conflict

SEVERITIES = (Severity.CAUTION, Severity.WARNING, Severity.CRITICAL)
"""In ascending order."""
SURE = 0.8
"""A less likely conflict is one level less severe, and raises an advisory only if the forecasts meet as they stand."""
SLACK_S = 1.0
"""A severity falls only once the time to the conflict is this much longer than its bound."""
SOON_S = 30.0
"""A queue, deadlock or blockage that begins within this time is a warning."""


def is_shallow(separation_m: float, probability: float, clearance_m: float) -> bool:
    """Whether a conflict is one level less severe: more than half the clearance is left, or it is less likely than
    `SURE`."""
    return separation_m > clearance_m / 2 or probability < SURE


def severity_level(time_s: float, is_lower: bool, warning_s: float, critical_s: float) -> int:
    """The severity of a conflict `time_s` ahead, as an index in `SEVERITIES`; one lower if shallow."""
    return max((time_s <= warning_s) + (time_s <= critical_s) - is_lower, 0)


def next_severity_change_s(
    contact_s: float, now_s: float, warning_s: float, critical_s: float, slack_s: float
) -> float:
    """When time alone next changes the severity of a conflict at `contact_s`; inf if it does not."""
    change_s = inf
    for bound_s in (warning_s, critical_s):
        for grown_s in (slack_s, 0.0):
            at_s = contact_s - bound_s - grown_s
            if at_s > now_s:
                change_s = min(change_s, at_s)
    return change_s


def severity_of(prediction: Prediction, now_s: float, before: Severity | None, settings: Conflict) -> Severity:
    """The severity by time to conflict.

    One level lower if more than half the clearance is left, or if the conflict is less likely than `SURE`. A severity
    falls only once the time has grown by `SLACK_S` beyond its bound.
    """
    time_s = prediction.contact_s - now_s
    is_lower = is_shallow(prediction.separation_m, prediction.probability, settings.clearance_m)

    def level(slack_s: float) -> int:
        bounds_s = settings.warning_s + slack_s, settings.critical_s + slack_s
        return severity_level(time_s, is_lower, *bounds_s)

    least = level(0.0)
    return SEVERITIES[least if before is None else max(least, min(SEVERITIES.index(before), level(SLACK_S)))]


def severity_of_finding(left_s: float) -> Severity:
    """The severity of a queue or blockage that begins in `left_s`."""
    return Severity.WARNING if left_s <= SOON_S else Severity.CAUTION


def severity_of_deadlock(left_s: float) -> Severity:
    """The severity of a deadlock that begins in `left_s`."""
    return Severity.CRITICAL if left_s <= 0 else severity_of_finding(left_s)


def rises(severity: Severity, before: Severity) -> bool:
    return SEVERITIES.index(severity) > SEVERITIES.index(before)
