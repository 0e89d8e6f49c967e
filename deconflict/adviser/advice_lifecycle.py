"""The life of advice as it is published: from what the adviser asks, through answers, to why it ended.

asked --> raised --(answered, or the robot has visibly begun)--> updated --> cleared
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from deconflict.adviser.asked import CANNOT, Asked, Request, reason_of
from deconflict.adviser.standoff_advice import StandoffAdvice
from deconflict.adviser.standoffs import Standing
from deconflict.advisories.words.advice_words import advice_headline, advice_summary
from deconflict.advisories.words.conflict_wording import new_id
from deconflict.advisories.words.words import Spot
from deconflict.contention.robots.robot_table import RobotTable
from deconflict.contention.robots.robot_view import RobotView
from deconflict.foresight.losses.loss import LossKind
from deconflict.foresight.losses.refusal import AdviceRefusal, HeldUp, stood_on
from deconflict.settings.site import Site
from deconflict.sweep.pair_choice import NO_CROWDS
from deconflict_client.advisory import AdviceAnswer, AdvisoryState, ClearedCode, Location, Severity, moment
from deconflict_client.advisory.robot_advice import ASKED, ENDED, REFUSED, REFUSED_S, RobotAdvice
from deconflict_client.verbs import Followed
from ingest.batch import Batch, FloorPoint
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


LOOK_S = 1.0
"""Time between two looks for standoffs."""


class AnsweredAdvice(NamedTuple):
    """What a vendor answered for its robot."""

    advice_id: str
    answer: AdviceAnswer
    why: str


class AdviceLifecycle:
    """The open advice of a floor."""

    def __init__(
        self,
        site: Site,
        describe: Callable[[Sequence[FloorPoint]], list[Spot]],
        measures: Measures,
        restored: Iterable[RobotAdvice] = (),
        crowds: Mapping[str, int] = NO_CROWDS,
    ) -> None:
        """`describe` names places. `restored` was open before a restart: the first look ends it, and asks anew.
        `crowds` has the robots that are in a crowd at each look."""
        self._site, self._describe, self._measures, self._crowds = site, describe, measures, crowds
        self.standoffs = StandoffAdvice(self._site, measures, crowds=crowds)
        """Of the last look; once `step` has raised, one that begins anew."""
        self._restored = list(restored)
        self._open: dict[str, RobotAdvice] = {}
        """By id of the request."""
        self._answers: dict[str, AnsweredAdvice] = {}
        """By id of the request, the first answer: that is the one that counts."""
        self.refusals = Refusals(measures)
        """Of what was asked."""
        self._followed: list[Followed] = []
        self._looked_s = float("-inf")

    def open(self) -> list[RobotAdvice]:
        """The newest revision of all that is open."""
        return [*self._restored, *self._open.values()]

    def take_followed(self) -> list[Followed]:
        """The robots that have visibly begun what they were asked, or were still at it when that ended, by the last
        look; none if they were taken."""
        followed, self._followed = self._followed, []
        return followed

    def receive(self, batch: Batch, robots: RobotTable) -> None:
        """Robots of a batch were updated."""
        self.standoffs.receive(batch, robots)

    def step(self, robots: RobotTable, now_s: float, answers: Iterable[AnsweredAdvice] = ()) -> list[RobotAdvice]:
        """The revisions of this look; none between looks, unless there are `answers` since the last call.

        If it raises, all that was open before is still to be ended, and what was learned of standoffs is forgotten.
        """
        answers = list(answers)
        if not answers and now_s - self._looked_s < LOOK_S:
            return []
        self._looked_s, before = now_s, self.open()
        try:
            return self._look(robots, now_s, answers)
        except Exception:
            self.standoffs = StandoffAdvice(self._site, self._measures, crowds=self._crowds)
            self._open, self._answers = {}, {}
            self._restored = before
            raise

    def withdraw_all(self, now_s: float) -> list[RobotAdvice]:
        """End all that is open: until the next `step` nothing is asked."""
        self.standoffs.end_all()
        withdrawn = [self._cleared(advice, ClearedCode.WITHDRAWN, now_s) for advice in self._open.values()]
        self._open, self._answers = {}, {}
        self.refusals.end_all()
        return [*self._end_restored(now_s), *withdrawn]

    def _end_restored(self, now_s: float) -> list[RobotAdvice]:
        restored, self._restored = self._restored, []
        return [self._cleared(advice, ClearedCode.RESTARTED, now_s) for advice in restored]

    def _look(self, robots: RobotTable, now_s: float, answers: Iterable[AnsweredAdvice]) -> list[RobotAdvice]:
        revisions = self._end_restored(now_s)
        self._take(answers, robots, now_s)
        before = dict(self.standoffs.asked)
        requests = self.standoffs.step(robots, now_s)
        known = (*before.values(), *self.standoffs.asked.values())
        begun = {asked.request: asked.begun_s for asked in known if asked.begun_s is not None}
        begun_s = {request.robot: at_s for request, at_s in begun.items()}
        self._followed = sorted((request.robot, request.other) for request in begun if request.other)
        self.refusals.look(self.standoffs.standing, begun_s, now_s)
        withdrawn = {request.id for request in requests if request.withdrawn}
        revisions += self._ended(before, withdrawn, robots, now_s)
        revisions += self._begun(now_s)
        revisions += self._raised([request for request in requests if not request.withdrawn], robots, now_s)
        return revisions

    def _take(self, answers: Iterable[AnsweredAdvice], robots: RobotTable, now_s: float) -> None:
        request_of = {advice.id: request_id for request_id, advice in self._open.items()}
        for answered in answers:
            if request_id := request_of.get(answered.advice_id):
                self._answers.setdefault(request_id, answered)
                self.standoffs.answer(request_id, answered.answer, answered.why, robots, now_s)

    def _ended(
        self, before: Mapping[str, Asked], withdrawn: set[str], robots: RobotTable, now_s: float
    ) -> Iterator[RobotAdvice]:
        """`before` has by id what was asked before this look.

        A robot has waited as asked once the robot that goes first has passed.
        """
        standing = self.standoffs.standing
        for request_id in [each for each in self._open if each not in self.standoffs.asked]:
            advice, answered = self._open.pop(request_id), self._answers.pop(request_id, None)
            request = before[request_id].request
            is_withdrawn = request_id in withdrawn and (request.id in withdrawn or request.robot not in robots)
            code = _why(advice, answered and answered.answer, is_withdrawn, robots, now_s)
            if is_refused(request_id, before[request_id], code, standing):
                unable = code is ClearedCode.DECLINED and answered is not None and reason_of(answered.why) == CANNOT
                self.refusals.add(advice, unable, standing, robots, now_s)
            yield self._cleared(advice, code, now_s)

    def _cleared(self, advice: RobotAdvice, code: ClearedCode, now_s: float) -> RobotAdvice:
        self._measures.count(ENDED, advice.vendor, advice.verb, code)
        because = code.because.format(name=advice.names[advice.robots.index(advice.robot)])
        return advice.cleared_revision(now_s, code, because)

    def _begun(self, now_s: float) -> Iterator[RobotAdvice]:
        for request_id, advice in self._open.items():
            asked = self.standoffs.asked[request_id]
            if asked.request.id == request_id and asked.begun_s is not None and not advice.begun_at:
                now = moment(now_s)
                self._open[request_id] = advice.next_revision(updated_at=now, begun_at=moment(asked.begun_s))
                yield self._open[request_id]

    def _raised(self, requests: Sequence[Request], robots: RobotTable, now_s: float) -> Iterator[RobotAdvice]:
        if not requests:
            return
        points = [_point(request, robots) for request in requests]
        for request, point, spot in zip(requests, points, self._describe(points), strict=True):
            self._open[request.id] = _advice(request, point, spot, robots, now_s)
            self._measures.count(ASKED, robots[request.robot].vendor, request.verb)
            yield self._open[request.id]


def _why(
    advice: RobotAdvice, answer: AdviceAnswer | None, is_withdrawn: bool, robots: RobotTable, now_s: float
) -> ClearedCode:
    """Why advice ended."""
    if answer == "declined":
        return ClearedCode.DECLINED
    if is_withdrawn:
        return ClearedCode.WITHDRAWN
    if advice.robot not in robots:
        return ClearedCode.LEFT
    return ClearedCode.LAPSED if now_s >= advice.latest_at.timestamp() else ClearedCode.DONE


def _at(request: Request) -> tuple[float, float] | None:
    return request.at or request.beside


def _point(request: Request, robots: RobotTable) -> FloorPoint:
    """Where to go, or where to wait; the place of the robot if there is none."""
    robot = robots[request.robot]
    return FloorPoint(robot.datum, *(_at(request) or robots.reported_pose(request.robot)[:2]))


def _advice(request: Request, point: FloorPoint, spot: Spot, robots: RobotTable, now_s: float) -> RobotAdvice:
    """The first revision of a request."""
    x_m, y_m, _ = robots.reported_pose(request.robot)
    robot, now = robots[request.robot], moment(now_s)
    involved = _involved(request, robots)
    other, place_text = robots[request.other].name if request.other else "", spot.text if _at(request) else ""
    headline = advice_headline(request.verb, robot.name, other, place_text, request.side)
    return RobotAdvice(
        id=new_id(f"advice {request.robot} {request.verb}", now_s),
        revision=1,
        state=AdvisoryState.RAISED,
        severity=Severity.CAUTION,
        robots=tuple(each.uuid for each in involved),
        names=tuple(each.name for each in involved),
        vendors=tuple(each.vendor for each in involved),
        participants=tuple(each.participant for each in involved),
        raised_at=now,
        updated_at=now,
        predicted_at=now,
        time_to_conflict_s=0.0,
        location=Location(datum=robot.datum, x=x_m, y=y_m),
        places=spot.places if _at(request) else (),
        summary=advice_summary(headline, request.latest_s - now_s, request.saving_s),
        headline=headline,
        robot=request.robot,
        vendor=robot.vendor,
        verb=request.verb,
        place=Location(datum=point.datum, x=point.x_m, y=point.y_m) if _at(request) else None,
        place_text=place_text,
        side=request.side,
        other=request.other,
        until=request.until,
        latest_at=moment(request.latest_s),
        saving_s=request.saving_s,
        saving_interval_s=request.saving_interval_s,
    )


def _involved(request: Request, robots: RobotTable) -> list[RobotView]:
    """The robot that is asked, and those for which it is, in ascending order."""
    uuids = {request.robot, *request.until, *((request.other,) if request.other else ())}
    return [robots[uuid] for uuid in sorted(uuids) if uuid in robots]
