"""What a situation may cost, how much of it a person can still prevent, and how severe that makes it. Pure.

The costs are rough amounts of time that robots lose: they order situations, and are no forecast of each.
"""

from collections.abc import Iterable
from typing import NamedTuple

from deconflict.advisories.severity import SEVERITIES
from deconflict.advisory import (
    AnyAdvisory,
    BlockageAdvisory,
    ClaimAdvisory,
    ConflictAdvisory,
    ContentionAdvisory,
    DeadlockAdvisory,
    EncounterClass,
    Severity,
)

REACTION_S = 3.0
"""The shortest useful reaction of a person or a site service. What begins sooner can't be prevented any more."""
ENCOUNTER_COST_S = {
    EncounterClass.HEAD_ON: 20.0,
    EncounterClass.CROSSING: 6.0,
    EncounterClass.FOLLOWING: 4.0,
    EncounterClass.STATIONARY_OBSTACLE: 8.0,
}
"""What the two robots lose if they get in each other's way."""
HELD_UP_COST_S, LOCKED_COST_S, CROWD_COST_S = 15.0, 60.0, 60.0
"""What a robot loses behind a blocker, and in a deadlock; and what a crowd costs."""
LASTS_S = 10.0
"""An encounter that began longer ago will not pass by itself: somebody can still end it."""
MOST_WAIT_S = 300.0
"""A longer wait costs no more than this."""
WARNING_COST_S, CRITICAL_COST_S = 3.0, 20.0
"""What a situation costs at least that is a warning, or critical."""
WARNING_S, CRITICAL_S = 30.0, 12.0
"""What begins later is less severe."""
KEPT_SHARE = 0.6
"""A severity falls only once the cost is below this share of its bound."""


class Stakes(NamedTuple):
    """What is at stake in some advisories."""

    cost_s: float
    """Expected loss if nobody does anything."""
    preventable_cost_s: float
    """The part of it that can still be prevented."""
    preventable_s: float | None
    """Time left until the next event that can still be prevented; None if there is none."""
    claim_severity: Severity
    """The severity of the claims among them, which cost no time."""


def cost_of(advisory: AnyAdvisory) -> float:
    """What an advisory's event is expected to cost, in seconds."""
    match advisory:
        case ConflictAdvisory():
            return (advisory.probability or 0.0) * ENCOUNTER_COST_S[advisory.encounter_class]
        case ContentionAdvisory():
            return min(advisory.wait_s * max(advisory.queue_length, 1), MOST_WAIT_S) * (advisory.probability or 1.0)
        case DeadlockAdvisory():
            return LOCKED_COST_S * len(advisory.cycle)
        case BlockageAdvisory():
            return HELD_UP_COST_S * len(advisory.holds_up)
        case ClaimAdvisory():
            return 0.0
        case _:
            return CROWD_COST_S


def stakes_of(advisories: Iterable[AnyAdvisory], now_s: float) -> Stakes:
    """What is at stake in all of them together."""
    cost_s = preventable_cost_s = 0.0
    times_s = []
    claim_severity = Severity.CAUTION
    for advisory in advisories:
        cost = cost_of(advisory)
        cost_s += cost
        left_s = advisory.time_left_s(now_s)
        if is_preventable(advisory, now_s):
            preventable_cost_s += cost
            times_s.append(left_s)
        if isinstance(advisory, ClaimAdvisory):
            claim_severity = max(claim_severity, advisory.severity, key=SEVERITIES.index)
    return Stakes(cost_s, preventable_cost_s, min(times_s, default=None), claim_severity)


def is_preventable(advisory: AnyAdvisory, now_s: float) -> bool:
    """Whether a person can still prevent the loss, or end it: not if it is about to begin or has just begun, and will
    pass by itself."""
    if not isinstance(advisory, ConflictAdvisory):
        return True
    ahead_s = advisory.predicted_at.timestamp() - now_s
    return ahead_s >= REACTION_S or ahead_s <= -LASTS_S


def severity_of_stakes(stakes: Stakes, before: Severity | None) -> Severity:
    """By what can still be prevented: its cost, and the time left. It falls only if the cost is clearly lower."""
    level = _level(stakes, 1.0)
    if before is not None:
        level = max(level, min(SEVERITIES.index(before), _level(stakes, KEPT_SHARE)))
    return max(SEVERITIES[level], stakes.claim_severity, key=SEVERITIES.index)


def _level(stakes: Stakes, share: float) -> int:
    """The severity as an index in `SEVERITIES`, with the bounds of the cost taken `share` times."""
    if stakes.preventable_s is None:
        return 0
    is_warning = stakes.preventable_cost_s >= share * WARNING_COST_S and stakes.preventable_s <= WARNING_S
    is_critical = stakes.preventable_cost_s >= share * CRITICAL_COST_S and stakes.preventable_s <= CRITICAL_S
    return is_warning + is_critical
