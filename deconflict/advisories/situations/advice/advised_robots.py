"""Which situation has which robot do something: no robot has to do two things at a time. Pure."""

from collections.abc import Collection

from deconflict.advisories.severity import SEVERITIES
from deconflict_client.advisory import AdvisoryState, Severity
from deconflict_client.situations import Situation


class AdvisedRobots:
    """The robots that the advice of open situations names."""

    def __init__(self) -> None:
        self._holder: dict[str, tuple[str, int]] = {}
        """By robot: the situation whose advice names it, and how urgent that is."""
        self._robots: dict[str, tuple[str, ...]] = {}
        """By situation: the robots that its advice names."""

    def busy(self, situation_id: str, urgency: Severity, robots: Collection[str]) -> set[str]:
        """Those of `robots` that advice of other situations names which are at least as urgent."""
        level = SEVERITIES.index(urgency)
        held = ((robot, self._holder.get(robot, (situation_id, 0))) for robot in robots)
        return {robot for robot, (holder, other_level) in held if holder != situation_id and other_level >= level}

    def keep(self, situation: Situation, urgency: Severity) -> set[str]:
        """Take the newest revision of a situation. The ids of those that lose a robot to it."""
        named = _named(situation)
        losing = {self._holder[robot][0] for robot in named if robot in self._holder} - {situation.id}
        for robot in self._robots.pop(situation.id, ()):
            if self._holder.get(robot, ("", 0))[0] == situation.id:
                del self._holder[robot]
        if named:
            self._robots[situation.id] = named
            self._holder |= dict.fromkeys(named, (situation.id, SEVERITIES.index(urgency)))
        return losing


def _named(situation: Situation) -> tuple[str, ...]:
    if situation.advice is None or situation.state is AdvisoryState.CLEARED:
        return ()
    return tuple(dict.fromkeys(action.robot for action in situation.advice.actions))
