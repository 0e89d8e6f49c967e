"""How severe an advisory is. A conflict: by the time that is left, how close the two come, and how likely it is.
Queues, deadlocks and blockages: by the time that is left.

The kernels of `watched_pair_kernels` compile `severity_level` and `next_severity_change_s`.
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


def severity_level(time_s: float, is_shallow: bool, warning_s: float, critical_s: float) -> int:
    """The severity of a conflict `time_s` ahead, as an index in `SEVERITIES`; one lower if shallow."""
    return max((time_s <= warning_s) + (time_s <= critical_s) - is_shallow, 0)


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
    is_shallow = prediction.separation_m > settings.clearance_m / 2 or prediction.probability < SURE

    def level(slack_s: float) -> int:
        bounds_s = settings.warning_s + slack_s, settings.critical_s + slack_s
        return severity_level(time_s, is_shallow, *bounds_s)

    least = level(0.0)
    return SEVERITIES[least if before is None else max(least, min(SEVERITIES.index(before), level(SLACK_S)))]


def severity_of_finding(left_s: float) -> Severity:
    """The severity of a queue, deadlock or blockage that begins in `left_s`."""
    return Severity.WARNING if left_s <= SOON_S else Severity.CAUTION


def rises(severity: Severity, before: Severity) -> bool:
    return SEVERITIES.index(severity) > SEVERITIES.index(before)
