"""What to do about a situation, and how long this stands. Pure.

Advice stands for `STANDS_S` at least; for people for `PEOPLE_STAND_S`, unless they can do something else instead. Then
it stands until everybody has had their time, until no advisory asks for it any more, or until something else is clearly
more urgent. What people have begun does not make way for what only programs have time for. It never names a robot that
the situation does not list, or that has something more urgent to do in another situation.
"""

from collections.abc import Collection, Iterator, Sequence

from deconflict.advice.actions.action_text import action_text
from deconflict.advice.document_limits import MOST_ACTION_BYTES, MOST_SUMMARY_BYTES, short_text
from deconflict.advisories.situations.advice.action_sets import GO_FIRST, PEOPLE_STAND_S, Proposal, key_of
from deconflict.advisories.situations.advice.stakes import cost_of
from deconflict_client.advisory import Action, ActionKind, moment
from deconflict_client.situations import SituationAdvice

STANDS_S = 4.0
"""Advice for programs stands for so long at least, unless its robot has left or its time is over."""
SOONER_S = 3.0
"""Other advice takes its place if that is for an event sooner by more than this."""
NO_LONGER: dict[ActionKind, str] = {
    "wait": "{name} does not have to wait any more",
    "slow_down": "{name} does not have to slow down any more",
    "take_another_route": "{name} does not need another route any more",
    "back_out": "{name} does not have to back out any more",
    "go_first": "it does not matter any more that {name} goes first",
    "look": "nobody has to go to {name} any more",
}
"""Why other advice takes its place if no advisory asks for it any more."""


def revised_advice(
    before: SituationAdvice | None, proposal: Proposal, robots: Collection[str], busy: Collection[str], now_s: float
) -> SituationAdvice | None:
    """The advice from now on: `before` as it is if it stands. `robots` are those that the situation lists. `busy` are
    those that have something more urgent to do in another situation."""
    if before is None:
        return _advice(proposal, now_s, "") if proposal.actions else None
    reason = _reason_to_change(before, proposal, robots, busy, now_s)
    if reason is None:
        return before
    return _advice(proposal, now_s, reason) if proposal.actions else None


def _reason_to_change(
    before: SituationAdvice, proposal: Proposal, robots: Collection[str], busy: Collection[str], now_s: float
) -> str | None:
    """Why other advice takes the place of `before`; None if it stands."""
    stood_s = now_s - before.since_at.timestamp()
    if impossible := _why_impossible(before, robots, busy, stood_s):
        return impossible
    if proposal.for_people and not before.for_people:
        return f"robots would lose about {_round_s(cost_of(proposal.first.advisory))} s otherwise"
    first = before.actions[0]
    asked = proposal.asked.get(key_of(first))
    is_beaten = asked is None and proposal.for_people
    if not is_beaten and 0.0 <= stood_s < (PEOPLE_STAND_S if before.for_people else STANDS_S):
        return None
    if asked is None:
        return NO_LONGER[first.action].format(name=first.name)
    may_replace = bool(proposal.actions) and (proposal.for_people or not before.for_people)
    is_sooner = may_replace and proposal.first.predicted_s < asked.predicted_s - SOONER_S
    sooner = proposal.actions[0] if is_sooner else first
    return None if sooner.robot == first.robot else f"there is less time for {sooner.name}"


def _round_s(seconds: float) -> int:
    return max(10 * round(seconds / 10), 10)


def _why_impossible(
    before: SituationAdvice, robots: Collection[str], busy: Collection[str], stood_s: float
) -> str | None:
    """Why nobody can do `before` any more, or all of it is done; None if neither is the case."""
    if left := next((action.name for action in before.actions if action.robot not in robots), None):
        return f"{left} is not part of this any more"
    if taken := next((action.name for action in before.actions if action.robot in busy), None):
        return f"{taken} has something more urgent to do"
    first = before.actions[0]
    timed_s = [action.seconds for action in before.actions if action.seconds is not None]
    is_over = first.action == "wait" and bool(timed_s) and stood_s >= max(timed_s)
    return f"the time for {first.name} to wait is over" if is_over else None


def _with_texts(actions: Sequence[Action]) -> Iterator[Action]:
    """The actions with their sentences. The last one says who goes first."""
    first = next((action.name for action in actions if action.action == GO_FIRST), None)
    last = [action for action in actions if action.action != GO_FIRST][-1:]
    for action in actions:
        so_that = f", so that {first} goes first" if first and action in last else ""
        text = "" if action.action == GO_FIRST else short_text(action_text(action) + so_that, MOST_ACTION_BYTES)
        yield action.model_copy(update={"text": text})


def _advice(proposal: Proposal, now_s: float, reason: str) -> SituationAdvice:
    actions = tuple(_with_texts(proposal.actions))
    return SituationAdvice(
        actions=actions,
        for_people=proposal.for_people,
        text="; ".join(action.text for action in actions if action.text),
        since_at=moment(now_s),
        changed_because=short_text(reason, MOST_SUMMARY_BYTES),
    )
