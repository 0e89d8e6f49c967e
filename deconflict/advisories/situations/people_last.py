"""People are asked only for what machines do not do, and for one new thing at a time. Pure.

Only advice for people waits. The situation itself is told at once, as severe as it is. Over the whole floor there is at
most about one new advice for people a minute: the most severe first, then the oldest.

Machines get all advice at once. People get only what no machine has accepted `ACCEPTS_WITHIN_S` after the first
request, or what one has accepted without effect.
"""

from collections.abc import Collection, Iterable, Sequence
from math import inf

from deconflict.advice.document_limits import MOST_SUMMARY_BYTES, listed, short_text
from deconflict.advisories.severity import SEVERITIES
from deconflict.advisories.situations.advice.action_sets import key_of, proposal_of
from deconflict.advisories.situations.advice.situation_advice import revised_advice
from deconflict.advisories.situations.situation_fields import Assessment
from deconflict_client.advisory import (
    AdvisoryState,
    AnyAdvisory,
    BlockageAdvisory,
    ClearedCode,
    ConflictAdvisory,
    DeadlockAdvisory,
    Severity,
)
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.situations import PeopleWaitFor, Situation, SituationAdvice

ACCEPTS_WITHIN_S = 10.0
"""People wait for so long after the first request that nobody has accepted; if all were declined, no longer."""
SETTLES_S = 3.0
"""What a robot has ended by doing what it was asked is still found for so long."""
FORGOTTEN_S = 30.0
"""A request that ended so long ago was of another standoff."""


class AskedRobots:
    """The requests to robots that are open, or ended lately."""

    def __init__(self) -> None:
        self._asked: dict[str, RobotAdvice] = {}
        """The newest revision of each, by id."""
        self._of_robot: dict[str, list[RobotAdvice]] = {}
        """The same by the robot that was asked."""

    def take(self, revisions: Iterable[RobotAdvice], now_s: float) -> None:
        """Revisions of requests, also those that only have an answer now."""
        self._asked |= {advice.id: advice for advice in revisions}
        self._asked = {name: each for name, each in self._asked.items() if _ended_s_ago(each, now_s) < FORGOTTEN_S}
        self._of_robot = {}
        for each in self._asked.values():
            self._of_robot.setdefault(each.robot, []).append(each)

    def should_end(self, advisory: AnyAdvisory, now_s: float) -> bool:
        """Whether people wait for what robots do about an advisory: what stands in the way of each other, and asks for
        nothing that only a person can do."""
        if not isinstance(advisory, ConflictAdvisory | DeadlockAdvisory | BlockageAdvisory):
            return False
        if isinstance(advisory, BlockageAdvisory) and _needs_person(advisory):
            return False
        asked = self._asked_about(advisory)
        done_s = max((_ended_s(each) for each in asked if each.cleared_code is ClearedCode.DONE), default=0.0)
        asked = [each for each in asked if each.raised_at.timestamp() >= done_s]
        first_s = min((each.raised_at.timestamp() for each in asked), default=0.0)
        if 0.0 <= now_s - first_s < ACCEPTS_WITHIN_S and not _is_refused(asked):
            return True
        agreed = [each for each in asked if _is_agreed(each)]
        return 0.0 <= now_s - done_s < SETTLES_S or (bool(agreed) and all(map(_is_open, agreed)))

    def tried(self, advisory: AnyAdvisory) -> list[str]:
        """Names of the robots that were asked about an advisory, in the order of the last requests."""
        asked = sorted(self._asked_about(advisory), key=lambda each: (each.raised_at, each.id))
        return list(dict.fromkeys(each.names[each.robots.index(each.robot)] for each in asked))

    def _asked_about(self, advisory: AnyAdvisory) -> list[RobotAdvice]:
        """What was asked of one of its robots for another of them."""
        robots = {*advisory.robots, None}
        return [each for robot in advisory.robots for each in self._of_robot.get(robot, ()) if each.other in robots]


def _needs_person(blockage: BlockageAdvisory) -> bool:
    """Whether somebody has to go to the robot that stands in the way: that others get around it does not end this."""
    advice = blockage.recommendation
    return advice is not None and any(action.action == "look" for action in advice.actions)


def _is_open(advice: RobotAdvice) -> bool:
    return advice.state is not AdvisoryState.CLEARED


def _is_agreed(advice: RobotAdvice) -> bool:
    """Whether its vendor has accepted it, or its robot has begun."""
    answer = advice.acknowledgement.answer if advice.acknowledgement else None
    return answer in {"accepted", "done"} or (answer is None and advice.begun_at is not None)


def _is_refused(asked: Sequence[RobotAdvice]) -> bool:
    """Whether all were declined, or withdrawn with one that was declined."""
    declined_at = {each.updated_at for each in asked if each.cleared_code is ClearedCode.DECLINED}
    return all(not _is_open(each) and each.updated_at in declined_at for each in asked)


def _ended_s(advice: RobotAdvice) -> float:
    return advice.updated_at.timestamp()


def _ended_s_ago(advice: RobotAdvice, now_s: float) -> float:
    """How long ago it ended, also if the clock has gone back since; below 0 if it is open."""
    return -1.0 if _is_open(advice) else abs(now_s - _ended_s(advice))


BETWEEN_S = 60.0
"""People are asked for something new so long after the last time."""
WAITS_S = 2.5
"""A situation that has not asked for a turn for so long does not wait for one any more."""
Rank = tuple[int, float]


class PeopleTurns:
    """Which situation may ask people for something new. What stands may change without a turn."""

    def __init__(self) -> None:
        self._asked_s = -inf
        """When people were last asked for something new."""
        self._waiting: dict[str, tuple[Rank, float]] = {}
        """By id of a situation that waits: its rank, the highest is next, and when it last asked for a turn."""

    def take(self, situation_id: str, severity: Severity, raised_s: float, now_s: float) -> bool:
        """Whether a situation may ask people now. It asks again at each look until it may."""
        self._waiting[situation_id] = (SEVERITIES.index(severity), -raised_s), now_s
        if 0.0 <= now_s - self._asked_s < BETWEEN_S:
            return False
        self._waiting = {name: each for name, each in self._waiting.items() if abs(now_s - each[1]) < WAITS_S}
        if max(self._waiting, key=lambda name: self._waiting[name][0]) != situation_id:
            return False
        self._asked_s = now_s
        del self._waiting[situation_id]
        return True


class PeopleLast:
    """When the situations of a floor ask people, where robots are asked, too."""

    def __init__(self) -> None:
        self._robots, self._turns = AskedRobots(), PeopleTurns()
        self._asked_s: dict[str, float] = {}
        """By id of an advisory: when a situation last asked people for something about it."""

    def take(self, requests: Iterable[RobotAdvice], now_s: float) -> None:
        """Revisions of what is asked of robots."""
        self._robots.take(requests, now_s)

    def given_now(
        self, situation_id: str, before: Situation | None, assessment: Assessment, busy: Collection[str], now_s: float
    ) -> Assessment:
        """The assessment of a situation with the advice that is given now, after the revision `before`.

        What people wait for, programs are advised at once.
        """
        advisories, robots, standing = assessment.advisories, assessment.robots, before.advice if before else None
        waiting = {each.id for each in advisories if self._waits(each, standing, now_s)}
        free = [robot for robot in robots if robot not in busy]
        proposal = proposal_of(advisories, free, now_s, assessment.stakes.passing | waiting)
        is_new = proposal.for_people and not _asks_people(standing)
        has_turn = not is_new or self._has_turn(situation_id, before, assessment, proposal.first.advisory, now_s)
        if not has_turn:
            proposal = proposal_of(advisories, free, now_s, {each.id for each in advisories})
        advice = revised_advice(standing, proposal, robots, busy, now_s)
        if advice and is_new and has_turn and (tried := self._robots.tried(proposal.first.advisory)):
            because = f"{listed(tried)} {'were' if len(tried) > 1 else 'was'} asked first, without effect"
            advice = advice.model_copy(update={"changed_because": short_text(because, MOST_SUMMARY_BYTES)})
        if advice and advice.for_people and (asking := proposal.asked.get(key_of(advice.actions[0]))):
            self._note(asking.advisory, now_s)
        is_held = _asks_people(assessment.possible) and not _asks_people(advice)
        first: PeopleWaitFor | None = ("robots" if waiting else None) if has_turn else "other_advice"
        return assessment._replace(advice=advice, people_wait_for=first if is_held else None)

    def _waits(self, advisory: AnyAdvisory, standing: SituationAdvice | None, now_s: float) -> bool:
        """Whether people wait for what robots do about an advisory. They do not if they are asked already."""
        if self._is_asked(advisory, now_s):
            return False
        asked = {action.robot for action in standing.actions} if standing and standing.for_people else set[str]()
        return asked.isdisjoint(advisory.robots) and self._robots.should_end(advisory, now_s)

    def _note(self, advisory: AnyAdvisory, now_s: float) -> None:
        self._asked_s[advisory.id] = now_s
        self._asked_s = {name: at_s for name, at_s in self._asked_s.items() if 0.0 <= now_s - at_s < BETWEEN_S}

    def _is_asked(self, advisory: AnyAdvisory, now_s: float) -> bool:
        """Whether people are asked about an advisory, or were lately: that is nothing new, in whichever situation."""
        return 0.0 <= now_s - self._asked_s.get(advisory.id, -inf) < BETWEEN_S

    def _has_turn(
        self, situation_id: str, before: Situation | None, assessment: Assessment, asking: AnyAdvisory, now_s: float
    ) -> bool:
        """Whether people may be asked about an advisory now. What is critical for one on foot waits for no turn."""
        if self._is_asked(asking, now_s):
            return True
        on_foot = any("person" in each.participants for each in assessment.advisories)
        if assessment.severity is Severity.CRITICAL and on_foot:
            return True
        raised_s = before.raised_at.timestamp() if before else now_s
        return self._turns.take(situation_id, assessment.severity, raised_s, now_s)


def _asks_people(advice: SituationAdvice | None) -> bool:
    return advice is not None and advice.for_people
