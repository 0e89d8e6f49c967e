"""The refusals of a floor: which requests were refused, and how long others stand because of it."""

from collections.abc import Mapping

from deconflict.adviser.asked import Asked
from deconflict.adviser.standoffs import Standing
from deconflict.contention.robots.robot_table import RobotTable
from deconflict.foresight.losses.loss import LossKind
from deconflict.foresight.losses.refusal import AdviceRefusal, HeldUp, stood_on
from deconflict_client.advisory import ClearedCode
from deconflict_client.advisory.robot_advice import REFUSED, REFUSED_S, RobotAdvice
from ingest.measures.measures import Measures

NOT_BEGUN = {ClearedCode.WITHDRAWN, ClearedCode.LAPSED, ClearedCode.DONE}
"""How a request ends that was refused without words, or whose robot says that it has done it where it stands."""

MOST_HELD_UP = 50
"""Of more robots that stand because of one refusal, the lost time is not counted."""


class Refusals:
    """Those whose robots still stand, and those that are over."""

    def __init__(self, measures: Measures) -> None:
        self._measures = measures
        self._open: dict[str, AdviceRefusal] = {}
        """By the robot that refused, its newest."""
        self._over: list[AdviceRefusal] = []

    def look(self, standing: Standing, begun_s: Mapping[str, float], now_s: float) -> None:
        """Count how long others stood since the last look; `begun_s` as of `stood_on`."""
        for robot, refusal in list(self._open.items()):
            self._open[robot], is_over = stood_on(refusal, standing.held_up_by(robot), begun_s, now_s)
            if is_over:
                self._end(robot)

    def add(self, advice: RobotAdvice, unable: bool, standing: Standing, robots: RobotTable, now_s: float) -> None:
        """Advice was refused, because its robot is `unable` or by will. That ends an earlier refusal of the robot."""
        robot, other = advice.robot, advice.other
        self._end(robot)
        if robot in robots and other is not None and other in robots:
            held_up = standing.held_up_by(robot)
            first = (other, *sorted(held_up - {other})[: MOST_HELD_UP - 1])
            mutual = held_up & standing.stands_for(robot)
            others = tuple(_held_up(uuid, robots, is_mutual=uuid in mutual) for uuid in first)
            self._open[robot] = AdviceRefusal(robot, advice.vendor, unable, now_s, now_s, others)

    def end_all(self) -> None:
        """Nothing is asked for a while."""
        for robot in list(self._open):
            self._end(robot)

    def take(self) -> list[AdviceRefusal]:
        """Those that are over since the last call."""
        over, self._over = self._over, []
        return over

    def _end(self, robot: str) -> None:
        if refusal := self._open.pop(robot, None):
            labels = refusal.vendor, "unable" if refusal.is_unable else "unwilling"
            self._measures.count(REFUSED, *labels)
            self._measures.count(REFUSED_S, *labels, by=sum(other.stood_s for other in refusal.others))
            self._over.append(refusal)


def is_refused(request_id: str, asked: Asked, code: ClearedCode, standing: Standing) -> bool:
    """Whether a request that ended with `code` was refused: declined, or not begun while its robot still stands."""
    if code is ClearedCode.DECLINED:
        return True
    is_of_wait = asked.request.id != request_id or asked.answer == "declined"
    robot = asked.request.robot
    stands = robot in standing.waiting or robot in standing.facing
    return code in NOT_BEGUN and asked.begun_s is None and not is_of_wait and stands


def _held_up(robot: str, robots: RobotTable, *, is_mutual: bool) -> HeldUp:
    kind = LossKind.DEADLOCK if is_mutual else LossKind.QUEUE
    return HeldUp(robot, robots[robot].vendor, kind, robots[robot].datum, *robots.reported_pose(robot)[:2])
