"""A floor whose engine asks robots, and robots whose vendors answer, obey or refuse."""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from math import cos, hypot, pi, sin
from typing import NamedTuple

from deconflict.adviser.advice_lifecycle import AnsweredAdvice
from deconflict.engine.engine import Engine
from deconflict.engine.load_shedding import Effort
from deconflict.foresight.losses.refusal import AdviceRefusal
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import DEFAULT, Site
from deconflict_client.advisory import AdviceAnswer, AdvisoryState, AnyAdvisory, ClearedCode
from deconflict_client.advisory.robot_advice import RobotAdvice
from ingest.batch import Batch
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.recording.log_reader import Received
from ingest.recording.recorder import Recorder
from tests.deconflict.adviser.floors import START_S, Robot

ASIDE_M, HALF_M = 1.2, 0.2
BACK_M = 0.75
"""How far a robot backs in a second."""


class Reply(NamedTuple):
    """What a vendor answers to advice, and what its robot then does each second."""

    answer: AdviceAnswer | None = None
    why: str = ""
    moves: Callable[[Robot, RobotAdvice, float], None] = lambda *_: None
    """Called each second, with how long ago it was asked, until that is done. What ends otherwise is given up."""
    done_s: float | None = None
    """How long after it was asked the vendor says that it is done."""


@dataclass
class AdvisedFloor:
    """Robots that report once a second to an engine, and hear at once what it asks."""

    robots: list[Robot]
    reply: Callable[[RobotAdvice], Reply] = lambda _: Reply()
    site: Site = DEFAULT
    effort: Effort = Effort.FULL
    recorder: Recorder | None = None
    """Records what the engine hears, and its passes, as the service does. Answers are in no log."""
    second: float = 0.0
    revisions: list[RobotAdvice] = field(default_factory=list)
    refusals: list[AdviceRefusal] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.engine = Engine(self.site)
        self._all = {robot.uuid: robot for robot in self.robots}
        self.names = {robot.uuid: robot.name for robot in self.robots}
        self.answers: list[AnsweredAdvice] = []
        """What the engine hears at the next look."""
        self.advisories: list[AnyAdvisory] = []
        """The revisions of the last second."""
        self._moving: dict[str, tuple[RobotAdvice, Reply]] = {}
        self._meet()

    @property
    def now_s(self) -> float:
        return START_S + self.second

    def run(self, seconds: int) -> "AdvisedFloor":
        for _ in range(seconds):
            self.second += 1.0
            self._move()
            self._look()
        return self

    def restart(self) -> None:
        """Go on with an engine that has what was open, and learned."""
        self.engine = self.engine.renewed(self.site)
        self._meet()

    def asked(self, verb: str = "") -> list[str]:
        """A line for each piece of advice, in their order. With a verb from the first of it on, which is second 0."""
        asked = [advice for advice in self.revisions if advice.state is AdvisoryState.RAISED]
        first = next((number for number, advice in enumerate(asked) if verb == advice.verb), 0)
        from_s = asked[first].raised_at.timestamp() if verb else START_S
        last = {advice.id: advice for advice in self.revisions}
        return [self._line(advice, last[advice.id], from_s) for advice in asked[first:]]

    def _meet(self) -> None:
        self.fleet = fleet_of(self.site, Measures())
        for robot in self.robots:
            self._hear(robot.identity())

    def _move(self) -> None:
        for advice, reply in self._moving.values():
            since_s = self.now_s - advice.raised_at.timestamp()
            reply.moves(self._all[advice.robot], advice, since_s)
            self.answers += [AnsweredAdvice(advice.id, "done", "")] if reply.done_s == since_s else []

    def _look(self) -> None:
        for robot in self.robots:
            self._hear(robot.status(self.now_s))
        if self.recorder:
            self.recorder.tick(self.now_s, self.effort, 0, self.engine.followed)
        self.engine.receive(Batch.from_bytes(self.fleet.next_batch(self.now_s).to_bytes()))
        self.advisories = self.engine.step(self.now_s)
        answers, self.answers = self.answers, []
        for advice in self.engine.advise(self.now_s, answers, self.effort):
            self._follow(advice)
        self.refusals += self.engine.refusals

    def _follow(self, advice: RobotAdvice) -> None:
        self.revisions.append(advice)
        if advice.state is AdvisoryState.RAISED:
            reply = self.reply(advice)
            self.answers += [AnsweredAdvice(advice.id, reply.answer, reply.why)] if reply.answer else []
            self._moving[advice.id] = advice, reply
        elif advice.cleared_code not in {None, ClearedCode.DONE}:
            self._moving.pop(advice.id, None)

    def _hear(self, message: dict[str, object]) -> None:
        number = list(self._all).index(uuid := str(message["uuid"])) + 1
        connection = Connection(number, "peer", f"/{self._all[uuid].maker}", self._all[uuid].maker)
        received = Received(json.dumps(message).encode(), self.now_s, connection)
        fault = self.fleet.receive_recorded(received)
        assert not fault, fault
        if self.recorder:
            self.recorder.received(received.raw, received.arrival_s, received.connection, None)

    def _line(self, advice: RobotAdvice, last: RobotAdvice, from_s: float) -> str:
        until = [f"until {self.names[uuid]} passed" for uuid in advice.until]
        asked = " ".join((self.names[advice.robot], advice.verb, "for", self.names[advice.other or ""], *until))
        raised_s, latest_s, ended_s = (
            at.timestamp() - from_s for at in (advice.raised_at, advice.latest_at, last.updated_at)
        )
        end = f"{last.cleared_code} at {ended_s:.0f}" if last.cleared_code else "open"
        return f"{raised_s:.0f}: {asked}, {latest_s:.0f} at the latest; {end}"


def forward(robot: Robot, metres: float) -> None:
    robot.x_m, robot.y_m = robot.x_m + metres * cos(robot.yaw_rad), robot.y_m + metres * sin(robot.yaw_rad)


def obeys(robot: Robot, advice: RobotAdvice, since_s: float) -> None:
    """Do what is asked, at 1 m/s."""
    if advice.verb == "go_around" and since_s == 1.0:
        robot.x_m, robot.y_m = robot.x_m - ASIDE_M * sin(robot.yaw_rad), robot.y_m + ASIDE_M * cos(robot.yaw_rad)
    elif advice.verb == "other_way" and since_s == 1.0:
        robot.yaw_rad += pi
    elif advice.verb in {"back_out", "step_aside"} and advice.place:
        dx_m, dy_m = advice.place.x - robot.x_m, advice.place.y - robot.y_m
        share = min(BACK_M / max(hypot(dx_m, dy_m), BACK_M), 1.0) if since_s else 0.0
        robot.x_m, robot.y_m = robot.x_m + share * dx_m, robot.y_m + share * dy_m
    elif advice.verb != "wait_before" and since_s >= 1.0:
        forward(robot, 1.0)


def begins(robot: Robot, _: RobotAdvice, since_s: float) -> None:
    """Begin, and stand again."""
    forward(robot, HALF_M if since_s == 1.0 else 0.0)


OBEYS, OBEYS_AND_SAYS_SO = Reply("accepted", moves=obeys), Reply("accepted", moves=obeys, done_s=8.0)
CANNOT, BUSY, NO_ROOM = (Reply("declined", why) for why in ("cannot", "busy", "no room"))
SILENT, UNBEGUN, HALF_DONE, DONE_STANDING = Reply(), Reply("accepted"), Reply("accepted", moves=begins), Reply("done")
