"""The advice on the advisories of a situation, and as much of it as agrees. Pure.

The actions of one advisory were worked out together, so they are taken as a whole or not at all. Sets are taken in the
order of their events while they agree: no robot has two different actions, no robots wait for each other in a ring, and
there are at most three actions. What is vague comes last. Waits before a conflict are lost for certain, so they are
advised only if the conflict is expected to cost more.

What people have time for, and what is worth their time, comes before what only programs can have done. The two are not
mixed.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from deconflict.advice.actions.action_text import SHORTEST_WAIT_S
from deconflict.advice.expected_loss import saves_time
from deconflict.advisories.situations.advice.stakes import SERVICE_REACTION_S, preventable_cost_of
from deconflict_client.advisory import Action, AnyAdvisory, ConflictAdvisory, Recommendation
from deconflict_client.situations import MOST_ACTIONS

GO_FIRST = "go_first"
PEOPLE_SAVE_S, PEOPLE_STAND_S = 10.0, 8.0
"""People are asked to do something only if it can prevent this much, and for no shorter time. It stands for so long at
least."""
PEOPLE_NOTICE_S = 8.0
"""A conflict that people are first asked to prevent begins no sooner than this: reading and acting take time."""
Key = tuple[str, str, bool]
"""The robot, the kind of action, and whether it is vague: what stays the same while advice stands."""


class ActionSet(NamedTuple):
    """What one advisory advises."""

    actions: tuple[Action, ...]
    advisory: AnyAdvisory
    waits: frozenset[tuple[str, str]]
    """Robots that wait, each with the robot that passes."""
    for_people: bool

    @property
    def predicted_s(self) -> float:
        """When the event begins that it prevents."""
        return self.advisory.predicted_at.timestamp()


@dataclass(slots=True)
class Proposal:
    """The actions that agree, the first to do first."""

    actions: tuple[Action, ...] = ()
    for_people: bool = False
    asked: Mapping[Key, ActionSet] = field(default_factory=dict)
    """By key of every action that any advisory asks for: the set that it is in, first of all one for people."""

    @property
    def first(self) -> ActionSet:
        """The set of the first action. If that is vague, another set may ask for the same and say where to go."""
        robot, kind, is_vague = key_of(self.actions[0])
        return self.asked.get((robot, kind, is_vague)) or self.asked[robot, kind, False]


def proposal_of(
    advisories: Sequence[AnyAdvisory], robots: Collection[str], now_s: float, passing: Collection[str] = ()
) -> Proposal:
    """The actions for `robots`: those that a situation lists, and that have nothing to do in another situation.

    `passing` are ids of advisories on what will probably end by itself: people are asked for nothing.
    """
    sets = sorted(_sets_of(advisories, robots, passing, now_s), key=_rank)
    asked: dict[Key, ActionSet] = {}
    for each in sorted(sets, key=lambda each: not each.for_people):
        for action in each.actions:
            asked.setdefault(key_of(action), each)
    asked = {key: each for key, each in asked.items() if not key[2] or (*key[:2], False) not in asked}
    for for_people in (True, False):
        if actions := _agreed([each for each in sets if each.for_people is for_people], _unsolved(advisories)):
            return Proposal(actions, for_people, asked)
    return Proposal(asked=asked)


def key_of(action: Action) -> Key:
    return action.robot, action.action, _is_vague(action)


def _is_vague(action: Action) -> bool:
    """Whether it does not say where to go."""
    return action.action == "take_another_route" and not action.where


def _rank(actions: ActionSet) -> tuple[bool, float, str]:
    return any(map(_is_vague, actions.actions)), actions.predicted_s, actions.actions[0].robot


def _sets_of(
    advisories: Iterable[AnyAdvisory], robots: Collection[str], passing: Collection[str], now_s: float
) -> Iterable[ActionSet]:
    for advisory in advisories:
        advice = advisory.recommendation
        if advice is None:
            continue
        actions = tuple(action for each in advice.actions if (action := _left_of(each, advice, advisory, now_s)))
        is_for_them = all(action.robot in robots for action in actions)
        if actions and is_for_them and _saves_time(advisory, actions, now_s):
            for_people = advisory.id not in passing and _is_for_people(advisory, actions, now_s)
            if for_people or all(action.action != "look" for action in actions):
                yield ActionSet(actions, advisory, _waits(advisory, actions), for_people)


def _is_for_people(advisory: AnyAdvisory, actions: Iterable[Action], now_s: float) -> bool:
    """Whether people who read it now have the time for it, and it is worth theirs."""
    timed_s = [action.seconds for action in actions if action.seconds is not None]
    is_long = max(timed_s, default=PEOPLE_STAND_S) >= PEOPLE_STAND_S
    return is_long and preventable_cost_of(advisory, now_s, PEOPLE_NOTICE_S) >= PEOPLE_SAVE_S


def _saves_time(advisory: AnyAdvisory, actions: Iterable[Action], now_s: float) -> bool:
    """Whether what is asked for before a conflict costs no more than it still saves."""
    if not isinstance(advisory, ConflictAdvisory):
        return True
    waits_s = [action.seconds or 0.0 for action in actions if action.action == "wait"]
    slow_s = [action.seconds or 0.0 for action in actions if action.action == "slow_down"]
    prevented_s = preventable_cost_of(advisory, now_s, SERVICE_REACTION_S)
    return prevented_s > 0.0 and saves_time(prevented_s, waits_s, slow_s)


def _left_of(action: Action, advice: Recommendation, advisory: AnyAdvisory, now_s: float) -> Action | None:
    """What is left of an action to do; None if a wait is over, or too short for people."""
    if action.action != "wait" or action.seconds is None:
        return action
    given_at = advice.given_at if isinstance(advisory, ConflictAdvisory) else None
    passed_s = max(now_s - given_at.timestamp(), 0.0) if given_at else 0.0
    left_s = float(round(action.seconds - passed_s))
    if left_s < SHORTEST_WAIT_S:
        return None
    return action if left_s == action.seconds else action.model_copy(update={"seconds": left_s})


def _waits(advisory: AnyAdvisory, actions: Sequence[Action]) -> frozenset[tuple[str, str]]:
    waiting = {action.robot for action in actions if action.action == "wait"}
    if not isinstance(advisory, ConflictAdvisory):
        return frozenset()
    passing = set(advisory.robots) - waiting
    return frozenset((waiter, robot) for waiter in waiting & set(advisory.robots) for robot in passing)


def _unsolved(advisories: Iterable[AnyAdvisory]) -> set[str]:
    """The robots of conflicts that have no advice: nobody can say which of the two goes first."""
    return {
        robot
        for advisory in advisories
        if isinstance(advisory, ConflictAdvisory)
        if not advisory.recommendation or not advisory.recommendation.actions
        for robot in advisory.robots
    }


def _agreed(sets: Iterable[ActionSet], unsolved: Collection[str]) -> tuple[Action, ...]:
    """The actions of as many sets as agree. At most one robot goes first, after what the others do; that alone asks
    nobody to do anything, and is no advice."""
    taken: dict[str, Action] = {}
    waits: set[tuple[str, str]] = set()
    for each in sets:
        merged = taken | {action.robot: _longer(action, taken.get(action.robot)) for action in each.actions}
        is_same = all(action.action == merged[robot].action for robot, action in taken.items())
        if is_same and len(merged) <= MOST_ACTIONS and not _has_ring(waits | each.waits):
            taken, waits = merged, waits | each.waits
    first = [action for action in taken.values() if action.action == GO_FIRST and action.robot not in unsolved]
    others = [action for action in taken.values() if action.action != GO_FIRST]
    return (*others, *first[:1]) if others else ()


def _longer(action: Action, other: Action | None) -> Action:
    """Of two waits of one robot the longer one."""
    is_shorter = (
        other is not None and other.action == action.action and (other.seconds or 0.0) >= (action.seconds or 0.0)
    )
    return other if other is not None and is_shorter else action


def _has_ring(waits: Iterable[tuple[str, str]]) -> bool:
    """Whether robots wait for each other in a ring."""
    left = set(waits)
    while left:
        waiters = {waiter for waiter, _ in left}
        held = {(waiter, passing) for waiter, passing in left if passing in waiters}
        if held == left:
            return True
        left = held
    return False
