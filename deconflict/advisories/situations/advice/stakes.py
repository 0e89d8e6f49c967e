"""What a situation may cost, how much of it a person can still prevent, and how severe that makes it. Pure.

The costs are rough amounts of time that robots lose: they order situations, and are no forecast of each.
"""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from deconflict.advice.actions.action_text import PERSON_REACTION_S
from deconflict.advice.expected_loss import expected_loss_s
from deconflict.advisories.severity import SEVERITIES
from deconflict.advisories.situations.advice.recurrences import Recurrence
from deconflict_client.advisory import (
    AnyAdvisory,
    BlockageAdvisory,
    ClaimAdvisory,
    ConflictAdvisory,
    ContentionAdvisory,
    DeadlockAdvisory,
    Severity,
)

SERVICE_REACTION_S = 0.5
"""The shortest useful reaction of a site service. What begins sooner it can't prevent any more."""
HELD_UP_COST_S, LOCKED_COST_S, CROWD_COST_S = 15.0, 60.0, 60.0
"""What a robot loses behind a blocker, and in a deadlock; and what a crowd costs."""
LASTS_S = 7.0
"""An encounter that began longer ago will not pass by itself: somebody can still end it."""
SAVED_SHARE = 0.1
"""The share of a queue's waits that a person can prevent, if no advice says how much it saves."""
MOST_WAIT_S = 300.0
"""A longer wait costs no more than this."""
WARNING_COST_S, CRITICAL_COST_S = 3.0, 40.0
"""What a situation costs at least that is a warning, or critical."""
WARNING_S, CRITICAL_S = 30.0, 12.0
"""What begins later is less severe."""
KEPT_SHARE, SLACK_S = 0.6, 2.0
"""A severity falls only once the cost is below this share of its bound, or the time beyond its bound by so much."""


class Stakes(NamedTuple):
    """What is at stake in some advisories."""

    cost_s: float
    """Expected loss if nobody does anything."""
    service_prevents_s: float
    """The part of it that a site service can still prevent."""
    person_prevents_s: float
    """The part of it that a person can still prevent."""
    preventable_s: float | None
    """Time left until the next event that a person can still prevent; None if there is none."""
    claim_severity: Severity
    """The severity of the claims among them, which cost no time."""
    recurring: Mapping[str, Recurrence]
    """Those that recur, by id."""

    @property
    def passing(self) -> set[str]:
        """Ids of those that will probably end by themselves."""
        return {name for name, recurrence in self.recurring.items() if recurrence.is_short}


def cost_of(advisory: AnyAdvisory) -> float:
    """What an advisory's event is expected to cost, in seconds."""
    match advisory:
        case ConflictAdvisory():
            return expected_loss_s(advisory)
        case ContentionAdvisory():
            return min(advisory.wait_s * max(advisory.queue_length, 1), MOST_WAIT_S) * (
                1.0 if advisory.probability is None else advisory.probability
            )
        case DeadlockAdvisory():
            return LOCKED_COST_S * len(advisory.cycle)
        case BlockageAdvisory():
            return HELD_UP_COST_S * len(advisory.holds_up)
        case ClaimAdvisory():
            return 0.0
        case _:
            return CROWD_COST_S


def stakes_of(
    advisories: Iterable[AnyAdvisory], now_s: float, recurring: Mapping[str, Recurrence] = MappingProxyType({})
) -> Stakes:
    """What is at stake in all of them together. People need not prevent what ends by itself each time."""
    cost_s = service_prevents_s = person_prevents_s = 0.0
    times_s = []
    claim_severity = Severity.CAUTION
    for advisory in advisories:
        cost_s += cost_of(advisory)
        service_prevents_s += preventable_cost_of(advisory, now_s, SERVICE_REACTION_S)
        is_passing = advisory.id in recurring and recurring[advisory.id].is_short
        if not is_passing and (prevented_s := preventable_cost_of(advisory, now_s, PERSON_REACTION_S)):
            person_prevents_s += prevented_s
            times_s.append(advisory.time_left_s(now_s))
        if isinstance(advisory, ClaimAdvisory):
            claim_severity = max(claim_severity, advisory.severity, key=SEVERITIES.index)
    soonest_s = min(times_s, default=None)
    return Stakes(cost_s, service_prevents_s, person_prevents_s, soonest_s, claim_severity, recurring)


def preventable_cost_of(advisory: AnyAdvisory, now_s: float, reaction_s: float) -> float:
    """How much of its cost can still be prevented or ended within `reaction_s`. Of a queue: what its advice saves. Of a
    conflict: nothing if it is about to begin or has just begun, as it will pass by itself."""
    if isinstance(advisory, ContentionAdvisory):
        advice = advisory.recommendation
        return advice.expected_saving_s if advice else SAVED_SHARE * cost_of(advisory)
    ahead_s = advisory.predicted_at.timestamp() - now_s
    is_passing = isinstance(advisory, ConflictAdvisory) and -LASTS_S < ahead_s < reaction_s
    return 0.0 if is_passing else cost_of(advisory)


def urgency_of_stakes(stakes: Stakes, before: Severity | None) -> Severity:
    """How severe it is if people can do something: by what they can still prevent, and the time left. It falls if one
    is clearly out of its bound."""
    level = _level(stakes, 1.0, 0.0)
    if before is not None:
        level = max(level, min(SEVERITIES.index(before), _level(stakes, KEPT_SHARE, SLACK_S)))
    return max(SEVERITIES[level], stakes.claim_severity, key=SEVERITIES.index)


def _level(stakes: Stakes, share: float, slack_s: float) -> int:
    """The severity as an index in `SEVERITIES`. `share` eases the bounds of the cost, `slack_s` those of the time."""
    if stakes.preventable_s is None:
        return 0
    cost_s, left_s = stakes.person_prevents_s / share, stakes.preventable_s - slack_s
    is_warning = cost_s >= WARNING_COST_S and left_s <= WARNING_S
    is_critical = cost_s >= CRITICAL_COST_S and left_s <= CRITICAL_S
    return is_warning + is_critical
