"""What to do about a situation: at most three actions for its robots, out of the advice on its advisories. Pure.

Advice stands until it is done, until its reason has gone, or until other advice is for something more urgent. A change
says why.
"""

from collections.abc import Collection, Iterable, Sequence
from math import inf
from typing import NamedTuple

from deconflict.advice.actions.action_text import action_text
from deconflict.advice.document_limits import MOST_SUMMARY_BYTES, short_text
from deconflict.advisories.situations.situation import MOST_ACTIONS, SituationAdvice
from deconflict.advisories.situations.stakes import SERVICE_REACTION_S, preventable_cost_of
from deconflict.advisory import Action, AnyAdvisory, ConflictAdvisory, Recommendation, moment

LEAST_WAIT_S = 3.0
"""Nobody can have a robot wait for less."""
STANDS_S = 4.0
"""Advice stands for so long at least, if it is not refused."""


Key = tuple[str, str, bool]
"""The robot, the kind of action, and whether it is vague: what stays the same while advice stands."""


class Proposal(NamedTuple):
    """An action, and when the event begins that it prevents."""

    action: Action
    predicted_s: float

    @property
    def key(self) -> Key:
        return _key(self.action)


def proposals_of(advisories: Iterable[AnyAdvisory], robots: Collection[str], now_s: float) -> list[Proposal]:
    """The first action for each robot of a situation, the first to do first."""
    found = [
        Proposal(action, advisory.predicted_at.timestamp())
        for advisory in advisories
        for action in useful_actions(advisory, now_s)
        if action.robot in robots
    ]
    found.sort(key=lambda proposal: (_rank(proposal.action), proposal.predicted_s, proposal.action.robot))
    first = {proposal.action.robot: proposal for proposal in reversed(found)}
    return [proposal for proposal in found if first[proposal.action.robot] is proposal]


def _rank(action: Action) -> int:
    """What is not vague comes first, and what changes nothing last."""
    return 2 if action.action == "go_first" else int(_is_vague(action))


def _key(action: Action) -> Key:
    return action.robot, action.action, _is_vague(action)


def _is_vague(action: Action) -> bool:
    """Whether it does not say where to go."""
    return action.action == "take_another_route" and not action.where


def useful_actions(advisory: AnyAdvisory, now_s: float) -> Sequence[Action]:
    """The actions on an advisory that can still be carried out; none if waiting costs more than what it prevents."""
    advice = advisory.recommendation
    if advice is None:
        return ()
    waits_s = [action.seconds or 0.0 for action in advice.actions if action.action == "wait"]
    prevented_s = preventable_cost_of(advisory, now_s, SERVICE_REACTION_S)
    if isinstance(advisory, ConflictAdvisory) and sum(waits_s) > prevented_s:
        return ()
    return [action for action in advice.actions if _is_timely(action, advice, now_s)]


def _is_timely(action: Action, advice: Recommendation, now_s: float) -> bool:
    """Whether somebody can carry out an action: it is long enough, and its time is not over since it was advised."""
    if action.action != "wait" or action.seconds is None:
        return True
    ends_s = advice.given_at.timestamp() + action.seconds if advice.given_at else inf
    return action.seconds >= LEAST_WAIT_S and now_s < ends_s


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
    keys: Collection[Key],
    proposed: Sequence[Proposal],
    robots: Collection[str],
    now_s: float,
) -> str | None:
    """Why other advice takes the place of `before`; None if it stands."""
    first, stood_s = before.actions[0], now_s - before.since_at.timestamp()
    if first.robot not in robots:
        return f"{first.name} is no longer part of it"
    if first.seconds is not None and stood_s >= max(action.seconds or 0.0 for action in before.actions):
        is_same = bool(proposed) and proposed[0].key == _key(first)
        return f"it is not over for {first.name} yet" if is_same else f"the time for {first.name} is over"
    if stood_s < STANDS_S or _key(first) in keys:
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
