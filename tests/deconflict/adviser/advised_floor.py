"""A floor whose engine asks robots, and robots whose vendors answer, obey or refuse."""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from math import cos, sin
from typing import NamedTuple

from deconflict.adviser.advice_lifecycle import AnsweredAdvice
from deconflict.advisory import AdviceAnswer, AdvisoryState
from deconflict.advisory.robot_advice import RobotAdvice
from deconflict.engine.engine import Engine
from deconflict.foresight.losses.refusal import AdviceRefusal
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import DEFAULT, Site
from ingest.batch import Batch
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.recording.log_reader import Received
from tests.deconflict.adviser.floors import START_S, Robot


class Reply(NamedTuple):
    """What a vendor answers to advice, and what its robot then does each second."""

    answer: AdviceAnswer | None = None
    why: str = ""
    moves: Callable[[Robot, RobotAdvice, float], None] = lambda *_: None
    """Called each second, with how long ago it was asked."""


@dataclass
class AdvisedFloor:
    """Robots that report once a second to an engine, and hear at once what it asks."""

    robots: list[Robot]
    reply: Callable[[RobotAdvice], Reply] = lambda _: Reply()
    site: Site = DEFAULT
    second: float = 0.0
    revisions: list[RobotAdvice] = field(default_factory=list)
    refusals: list[AdviceRefusal] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.fleet, self.engine = fleet_of(self.site, Measures()), Engine(self.site)
        self._all = {robot.uuid: robot for robot in self.robots}
        self.names = {robot.uuid: robot.name for robot in self.robots}
        self._answers: list[AnsweredAdvice] = []
        self._moving: dict[str, tuple[RobotAdvice, Reply]] = {}
        for robot in self.robots:
            self._hear(robot.identity())

    @property
    def now_s(self) -> float:
        return START_S + self.second

    def run(self, seconds: int) -> "AdvisedFloor":
        for _ in range(seconds):
            self.second += 1.0
            self.look()
        return self

    def look(self) -> None:
        """Hear all robots, and advise."""
        for advice, reply in self._moving.values():
            reply.moves(self._all[advice.robot], advice, self.now_s - advice.raised_at.timestamp())
        for robot in self.robots:
            self._hear(robot.status(self.now_s))
        self.engine.receive(Batch.from_bytes(self.fleet.next_batch(self.now_s).to_bytes()))
        self.engine.step(self.now_s)
        answers, self._answers = self._answers, []
        self.publish(self.engine.advise(self.now_s, answers))
        self.refusals += self.engine.refusals

    def publish(self, revisions: list[RobotAdvice]) -> None:
        for advice in revisions:
            self.revisions.append(advice)
            if advice.state is AdvisoryState.RAISED:
                reply = self.reply(advice)
                self._answers += [AnsweredAdvice(advice.id, reply.answer, reply.why)] if reply.answer else []
                self._moving[advice.id] = advice, reply

    def asked(self) -> list[str]:
        """A line for each piece of advice, in the order in which they were asked."""
        last = {advice.id: advice for advice in self.revisions}
        return [
            self._line(advice, last[advice.id]) for advice in self.revisions if advice.state is AdvisoryState.RAISED
        ]

    def _line(self, advice: RobotAdvice, last: RobotAdvice) -> str:
        until = [f"until {self.names[uuid]} passed" for uuid in advice.until]
        latest_s = (advice.latest_at - advice.raised_at).total_seconds()
        asked = " ".join((self.names[advice.robot], advice.verb, "for", self.names[advice.other or ""], *until))
        ended_s = last.updated_at.timestamp() - START_S
        end = f"{last.cleared_code} at {ended_s:.0f}" if last.cleared_code else "open"
        return f"{advice.raised_at.timestamp() - START_S:.0f}: {asked} or {latest_s:.0f} s; {end}"

    def _hear(self, message: dict[str, object]) -> None:
        maker = self._all[str(message["uuid"])].maker
        fault = self.fleet.receive_recorded(
            Received(json.dumps(message).encode(), self.now_s, Connection(1, "peer", f"/{maker}", maker))
        )
        assert not fault, fault


def forward(robot: Robot, metres: float) -> None:
    robot.x_m, robot.y_m = robot.x_m + metres * cos(robot.yaw_rad), robot.y_m + metres * sin(robot.yaw_rad)
