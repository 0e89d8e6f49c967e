"""Floors on which an adviser hears robots that stand where a test puts them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from math import cos, pi, sin
from typing import Any
from uuid import NAMESPACE_URL, uuid5

from deconflict.adviser import Adviser, Request

START_S = 1_780_000_000.0
LOWER, UPPER = (str(uuid5(NAMESPACE_URL, name)) for name in ("lower hall", "upper hall"))
Point = tuple[float, float]


@dataclass
class Robot:
    """A robot that means to drive straight on, as long as nobody moves it."""

    name: str
    maker: str
    x_m: float
    y_m: float
    yaw_rad: float
    datum: str = LOWER
    z_m: float = 0.0
    means_to_go: bool = True
    by_destination: bool = False
    """It says only where it goes, and not when."""

    @property
    def uuid(self) -> str:
        return str(uuid5(NAMESPACE_URL, self.name))

    def identity(self) -> dict[str, Any]:
        envelope = {"x": 1.1, "y": 0.7, "z": 1.2}
        names = {"manufacturerName": self.maker, "robotModel": "Q", "robotSerialNumber": self.name}
        return {"uuid": self.uuid, "timestamp": stamp(START_S), "baseRobotEnvelope": envelope, **names}

    def status(self, now_s: float) -> dict[str, Any]:
        ahead = range(1, 9) if self.means_to_go and not self.by_destination else ()
        bound_m = [8] if self.means_to_go and self.by_destination else []
        return {
            "uuid": self.uuid,
            "timestamp": stamp(now_s),
            "operationalState": "navigating",
            "location": {**self._place(0.0), "planarDatum": self.datum},
            "velocity": {"linear": 0.0},
            "path": [{"timestamp": stamp(now_s + k), "planarDatum": self.datum, **self._place(k)} for k in ahead],
            "destinations": [{"planarDatum": self.datum, **self._place(at_m)} for at_m in bound_m],
        }

    def _place(self, ahead_m: float) -> dict[str, Any]:
        x_m, y_m = self.x_m + ahead_m * cos(self.yaw_rad), self.y_m + ahead_m * sin(self.yaw_rad)
        angle = {"x": 0.0, "y": 0.0, "z": sin(self.yaw_rad / 2), "w": cos(self.yaw_rad / 2)}
        return {"x": x_m, "y": y_m, "z": self.z_m, "angle": angle}


@dataclass
class Floor:
    """Robots that an adviser hears once a second."""

    robots: tuple[Robot, ...]
    adviser: Adviser = field(default_factory=Adviser)
    now_s: float = START_S

    def __post_init__(self) -> None:
        self.adviser.hear(self.now_s, [robot.identity() for robot in self.robots])

    def second(self) -> list[Request]:
        self.now_s += 1.0
        return self.adviser.hear(self.now_s + 0.1, [robot.status(self.now_s) for robot in self.robots])

    def seconds(self, count: int, answer: Callable[[Request], tuple[str, ...]] | None = None) -> list[Request]:
        """All that is asked, or withdrawn; `answer` has each answer and its reason, at once."""
        return [request for _ in range(count) for request in self._answered(self.second(), answer)]

    def _answered(
        self, requests: list[Request], answer: Callable[[Request], tuple[str, ...]] | None
    ) -> Iterator[Request]:
        for request in requests:
            if answer and not request.withdrawn:
                self.adviser.answer(request.id, *answer(request))  # type: ignore[arg-type]
            yield request

    def until(self, verb: str) -> Request:
        """The first request of a verb."""
        return next(request for _ in range(40) for request in self.second() if request.verb == verb)

    def robot(self, uuid: str) -> Robot:
        return next(robot for robot in self.robots if robot.uuid == uuid)


def stamp(at_s: float) -> str:
    return datetime.fromtimestamp(at_s, UTC).isoformat()


def face_to_face(x_m: float = 0.0, y_m: float = 0.0, name: str = "", **place: Any) -> tuple[Robot, Robot]:
    left, right = Robot(f"l{name}", "Larch", x_m, y_m, 0.0), Robot(f"r{name}", "Rowan", x_m + 1.6, y_m, pi, **place)
    return left, right


def before_crossing() -> tuple[Robot, Robot]:
    return Robot("e", "Larch", -2.0, 0.0, 0.0), Robot("n", "Rowan", 0.0, -2.0, pi / 2)
