"""What to do about a situation: at most three actions for its robots, out of the advice on its advisories. Pure.

Advice stands until it is done, until its reason has gone, or until other advice is for something more urgent. A change
says why.
"""

from collections.abc import Collection, Iterable, Sequence
from typing import NamedTuple

from deconflict.advice.actions.action_text import action_text
from deconflict.advice.document_limits import MOST_SUMMARY_BYTES, short_text
from deconflict.advisories.situations.situation import MOST_ACTIONS, SituationAdvice
from deconflict.advisory import Action, AnyAdvisory, ConflictAdvisory, moment

LEAST_WAIT_S = 3.0
"""Nobody can have a robot wait for less."""
STANDS_S = 4.0
"""Advice stands for so long at least, if it is not refused."""


class Proposal(NamedTuple):
    """An action, and when the event begins that it prevents."""

    action: Action
    predicted_s: float

    @property
    def key(self) -> tuple[str, str]:
        return self.action.robot, self.action.action


def proposals_of(advisories: Iterable[AnyAdvisory], robots: Collection[str], now_s: float) -> list[Proposal]:
    """The first action for each robot of a situation, the first to do first."""
    found = [
        Proposal(action, advisory.predicted_at.timestamp())
        for advisory in advisories
        for action in actions_of(advisory)
        if action.robot in robots and is_useful(action, advisory, now_s)
    ]
    found.sort(key=lambda proposal: (proposal.action.action == "go_first", proposal.predicted_s, proposal.action.robot))
    first = {proposal.action.robot: proposal for proposal in reversed(found)}
    return [proposal for proposal in found if first[proposal.action.robot] is proposal]


def actions_of(advisory: AnyAdvisory) -> Sequence[Action]:
    return advisory.recommendation.actions if advisory.recommendation else ()


def is_useful(action: Action, advisory: AnyAdvisory, now_s: float) -> bool:
    """Whether there is still time for it, and somebody can carry it out."""
    if action.action == "wait" and (action.seconds or 0.0) < LEAST_WAIT_S:
        return False
    return not isinstance(advisory, ConflictAdvisory) or advisory.time_left_s(now_s) > 0


def revised_advice(
    before: SituationAdvice | None, proposals: Sequence[Proposal], robots: Collection[str], now_s: float
) -> SituationAdvice | None:
    """The advice from now on: `before` as it is if it stands."""
    proposed = proposals[:MOST_ACTIONS]
    if before is None:
        return _advice(proposed, now_s, "") if proposed else None
    reason = _reason_to_change(before, {proposal.key for proposal in proposals}, proposed, robots, now_s)
    if reason is None:
        return before
    return _advice(proposed, now_s, reason) if proposed else None


def _reason_to_change(
    before: SituationAdvice,
    keys: Collection[tuple[str, str]],
    proposed: Sequence[Proposal],
    robots: Collection[str],
    now_s: float,
) -> str | None:
    """Why other advice takes the place of `before`; None if it stands."""
    first, stood_s = before.actions[0], now_s - before.since_at.timestamp()
    if first.robot not in robots:
        return f"{first.name} is no longer part of it"
    if first.seconds is not None and stood_s >= first.seconds:
        is_same = bool(proposed) and proposed[0].key == (first.robot, first.action)
        return f"it is not over for {first.name} yet" if is_same else f"the time for {first.name} is over"
    if stood_s < STANDS_S or (first.robot, first.action) in keys:
        return None
    if not proposed:
        return None if first.seconds is not None else f"{first.name} no longer needs to"
    return f"{proposed[0].action.name} is now the first to act"


def _advice(proposals: Sequence[Proposal], now_s: float, reason: str) -> SituationAdvice:
    actions = tuple(proposal.action for proposal in proposals)
    text = "; ".join(action_text(action) for action in actions)
    return SituationAdvice(
        actions=actions,
        text=short_text(text, MOST_SUMMARY_BYTES),
        since_at=moment(now_s),
        changed_because=short_text(reason, MOST_SUMMARY_BYTES),
    )
