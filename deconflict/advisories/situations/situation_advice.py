"""What to do about a situation, and how long this stands. Pure.

Advice stands for `STANDS_S` at least. Then it stands until everybody has had their time, until no advisory asks for it
any more, or until something else is clearly more urgent. It never names a robot that the situation does not list.
"""

from collections.abc import Collection

from deconflict.advice.actions.action_text import action_text
from deconflict.advice.document_limits import MOST_SUMMARY_BYTES, short_text
from deconflict.advisories.situations.action_sets import Proposal, key_of
from deconflict.advisories.situations.situation import SituationAdvice
from deconflict.advisory import moment

STANDS_S = 4.0
"""Advice stands for so long at least, unless its robot has left or its time is over."""
SOONER_S = 3.0
"""Other advice takes its place if that is for an event sooner by more than this."""


def revised_advice(
    before: SituationAdvice | None, proposal: Proposal, robots: Collection[str], now_s: float
) -> SituationAdvice | None:
    """The advice from now on: `before` as it is if it stands. `robots` are those that the situation lists."""
    if before is None:
        return _advice(proposal, now_s, "") if proposal.actions else None
    reason = _reason_to_change(before, proposal, robots, now_s)
    if reason is None:
        return before
    return _advice(proposal, now_s, reason) if proposal.actions else None


def _reason_to_change(before: SituationAdvice, proposal: Proposal, robots: Collection[str], now_s: float) -> str | None:
    """Why other advice takes the place of `before`; None if it stands."""
    first, stood_s = before.actions[0], now_s - before.since_at.timestamp()
    left = next((action.name for action in before.actions if action.robot not in robots), None)
    if left is not None:
        return f"{left} is not part of this any more"
    asked_s = proposal.asked_s.get(key_of(first))
    if first.action == "wait" and stood_s >= max(action.seconds or 0.0 for action in before.actions):
        return f"the time for {first.name} to wait is over"
    if 0.0 <= stood_s < STANDS_S:
        return None
    if asked_s is None:
        return f"earlier advice to {first.name} does not help any more"
    sooner = proposal.actions[0] if proposal.actions and proposal.predicted_s < asked_s - SOONER_S else first
    return None if sooner.robot == first.robot else f"there is less time for {sooner.name}"


def _advice(proposal: Proposal, now_s: float, reason: str) -> SituationAdvice:
    return SituationAdvice(
        actions=proposal.actions,
        text=short_text("; ".join(map(action_text, proposal.actions)), MOST_SUMMARY_BYTES),
        since_at=moment(now_s),
        changed_because=short_text(reason, MOST_SUMMARY_BYTES),
    )
