"""Situations for all that is published. A fault in them never holds up advisories: machines act on those."""

import logging
from collections.abc import Collection, Iterable, Mapping, Sequence
from math import inf

from deconflict.advisories.situations.people_last import PeopleLast
from deconflict.advisories.situations.situation_counts import (
    SITUATION_FAILURES,
    SituationCounts,
    set_open_situations,
)
from deconflict.advisories.situations.situation_lifecycle import Describe, SituationLifecycle
from deconflict_client.advisory import AdvisoryState, AnyAdvisory, ClearedCode
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.situations import AnyRevision, Situation, advisories_of, situations_of
from ingest.measures.measures import Measures

MEASURED_EVERY_S = 1.0
"""How many situations are open is measured so often."""

log = logging.getLogger(__name__)


class SituationPublisher:
    """Makes situations of what each pass publishes."""

    def __init__(self, describe: Describe, people: PeopleLast | None = None) -> None:
        """`people` as in `SituationLifecycle`."""
        self._people = people
        self._lifecycle = SituationLifecycle(describe, people)
        self._open: dict[str, Situation] = {}
        """The newest revision of each open situation that was given out, by id."""
        self._counts = SituationCounts()
        self._has_failed = False
        """Whether what was open before a restart could not be taken in."""
        self._measures: Measures | None = None
        self._measured_s = -inf
        """When it was last measured how many are open, and where."""

    def renew(self, describe: Describe) -> None:
        """Name places by a changed site."""
        self._lifecycle.describe = describe

    def restore(self, revisions: Collection[AnyRevision]) -> None:
        """Continue what was open before a restart: the newest revisions of situations and advisories."""
        situations = situations_of(revisions)
        self._open = {situation.id: situation for situation in situations}
        self._counts.restore(situations)
        try:
            self._lifecycle.restore(situations, advisories_of(revisions))
        except Exception:
            log.exception("open situations can't be continued, which should be reported")
            self._has_failed = True

    def stamped(self, revisions: Iterable[AnyAdvisory]) -> list[AnyAdvisory]:
        """The revisions of advisories with the ids of the situations that they are part of so far."""
        return self._lifecycle.stamped(revisions)

    def stamped_advice(self, advice: Iterable[RobotAdvice]) -> list[RobotAdvice]:
        """What is asked of robots, with the id of the newest situation that is open and has the robot and the one for
        which it is asked. None if there is none yet: robots are asked before people are told."""
        of_robot: dict[str, list[Situation]] = {}
        for situation in self._open.values():
            for robot in situation.robots:
                of_robot.setdefault(robot, []).append(situation)
        return [each.model_copy(update={"situation_id": _situation_with(each, of_robot)}) for each in advice]

    def revise(self, now_s: float, revisions: Sequence[AnyAdvisory], measures: Measures) -> list[Situation]:
        """The revisions of situations that follow from those of advisories in one pass, and from the time."""
        situations = self._revise(now_s, revisions)
        if situations is None or self._has_failed:
            measures.count(SITUATION_FAILURES)
            situations = self._begin_anew(now_s)
        self._open |= {situation.id: situation for situation in situations}
        for situation in situations:
            if situation.state is AdvisoryState.CLEARED:
                self._open.pop(situation.id, None)
        self._counts.count(measures, situations)
        if measures is not self._measures or not 0.0 <= now_s - self._measured_s < MEASURED_EVERY_S:
            self._measures, self._measured_s = measures, now_s
            set_open_situations(measures, self._open.values())
        return situations

    def _revise(self, now_s: float, revisions: Sequence[AnyAdvisory]) -> list[Situation] | None:
        """None if they can't be made."""
        try:
            return self._lifecycle.revise(now_s, revisions)
        except Exception:
            log.exception("situations can't be made and begin anew, which should be reported")
            return None

    def _begin_anew(self, now_s: float) -> list[Situation]:
        """Clear every situation; the advisories make new ones."""
        before, self._lifecycle = self._lifecycle, SituationLifecycle(self._lifecycle.describe, self._people)
        self._lifecycle.restore((), before.advisories())
        self._has_failed = False
        return [each.cleared_revision(now_s, ClearedCode.FAULT) for each in self._open.values()]


def _situation_with(advice: RobotAdvice, of_robot: Mapping[str, list[Situation]]) -> str | None:
    """`of_robot` are the open situations by robot."""
    other = advice.other or advice.robot
    found = [situation for situation in of_robot.get(advice.robot, ()) if other in situation.robots]
    return max(found, key=lambda situation: (situation.raised_at, situation.id)).id if found else None
