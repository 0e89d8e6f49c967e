"""How severe an advisory is. A conflict: by the time that is left, how likely it is, and how close the two come.
Queues, deadlocks and blockages: by the time that is left. What is never more or less severe, as a claim, has a fixed
severity where its finding is made.

The severity of a conflict rises and falls:

1. By time, it is critical within `conflict.critical_s`, a warning within `conflict.warning_s`, otherwise a caution.
2. It is one level lower if it is less likely than `SURE`, or if more than half the clearance is left.
3. It is a caution if it is less likely than `conflict.raise_probability`.
4. It rises at once. It falls once these bounds, eased by `SLACK_S` and `KEPT_SHARE`, have asked for less for `FALLS_S`.

The kernels of `watched_pair_kernels` compile `severity_level`.
"""

from deconflict.settings.site import Conflict
from deconflict_client.advisory import Severity

SEVERITIES = (Severity.CAUTION, Severity.WARNING, Severity.CRITICAL)
"""In ascending order."""
SURE = 0.8
"""A less likely conflict is one level less severe, and raises an advisory only if the forecasts meet as they stand."""
SLACK_S = 1.0
"""A level is kept while the time to the conflict is at most this much longer than its bound."""
KEPT_SHARE = 0.75
"""A level is kept while the probability is at least this share of its bound, and the bound of the separation at least
this share of the separation."""
FALLS_S = 1.0
"""A severity falls after it should have been lower for this long. Meanwhile the advisory stands as it is. The
probability of an advisory whose conflict is too unlikely for it to stand is published after the same time."""
SOON_S = 30.0
"""A queue, deadlock or blockage that begins within this time is a warning."""


def severity_level(time_s: float, separation_m: float, probability: float, limits: Conflict, is_kept: bool) -> int:
    """The severity of a conflict `time_s` ahead, as an index in `SEVERITIES`; by the eased bounds if `is_kept`."""
    slack_s, share = (SLACK_S, KEPT_SHARE) if is_kept else (0.0, 1.0)
    if probability < limits.raise_probability * share:
        return 0
    is_lower = separation_m * share > limits.clearance_m / 2 or probability < SURE * share
    return max((time_s <= limits.warning_s + slack_s) + (time_s <= limits.critical_s + slack_s) - is_lower, 0)


def severity_of(
    time_s: float, separation_m: float, probability: float, before: Severity | None, settings: Conflict
) -> Severity:
    """The severity of a conflict `time_s` ahead. `before` is that of its advisory, None if it has none yet.

    Whether a fall has been due for `FALLS_S` is decided in `watched_pair_kernels`.
    """
    least = severity_level(time_s, separation_m, probability, settings, is_kept=False)
    if before is None:
        return SEVERITIES[least]
    most = severity_level(time_s, separation_m, probability, settings, is_kept=True)
    return SEVERITIES[max(least, min(SEVERITIES.index(before), most))]


def severity_of_finding(left_s: float) -> Severity:
    """The severity of a queue or blockage that begins in `left_s`."""
    return Severity.WARNING if left_s <= SOON_S else Severity.CAUTION


def severity_of_deadlock(left_s: float) -> Severity:
    """The severity of a deadlock that begins in `left_s`."""
    return Severity.CRITICAL if left_s <= 0 else severity_of_finding(left_s)


def rises(severity: Severity, before: Severity) -> bool:
    return SEVERITIES.index(severity) > SEVERITIES.index(before)
