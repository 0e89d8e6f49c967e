"""What was asked of robots, and for which advisories people therefore wait. Pure.

Machines get all advice at once. People get only what no machine has accepted `ACCEPTS_WITHIN_S` after the first
request, or what one has accepted without effect.
"""

from collections.abc import Iterable, Sequence

from deconflict_client.advisory import (
    AdvisoryState,
    AnyAdvisory,
    BlockageAdvisory,
    ClearedCode,
    ConflictAdvisory,
    DeadlockAdvisory,
)
from deconflict_client.advisory.robot_advice import RobotAdvice

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
