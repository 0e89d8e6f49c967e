"""How drawn robots move, and the messages that they send."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import cos, hypot, sin
from typing import Literal, NamedTuple, Self
from uuid import NAMESPACE_DNS, uuid5

import numpy as np

from benchmarks.planned_floors.logs.messages import stamp
from ingest.batch import Floats

START_S = 1_790_000_000
"""Second 0 of every floor, since the epoch."""
HALL = "0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1b01"
PATH_S = 10
"""Points of a path, one a second."""
DOCK_M, LANE_M = (6.0, 6.0), ((0.0, 12.0), (24.0, 12.0))
"""The middle of a dock on every floor, and the ends of a lane."""
Says = Literal["path", "straight", "waits", "bound", "speed", "nothing"]
"""What a robot says of its way: where it will be, that it goes straight on, the same while it stands, that it goes to
the dock, that it moves, or nothing."""
WAITS_MPS = 1.0
"""The speed on the path of a robot that waits on it."""
Span = tuple[float, float]

_STATUS = (
    '{"uuid":"%s","timestamp":"%s","operationalState":"%s","location":{"x":%.3f,"y":%.3f,"angle":{"x":0,"y":0,'
    '"z":%.6f,"w":%.6f},"planarDatum":"%s"},"velocity":{"linear":%.3f}%s}'
)
_POINT = '{"timestamp":"%s","x":%.3f,"y":%.3f,"angle":{"x":0,"y":0,"z":%.6f,"w":%.6f},"planarDatumUUID":"%s"}'
_IDENTITY = (
    '{"uuid":"%s","timestamp":"%s","manufacturerName":"%s","robotModel":"M1","robotSerialNumber":"%s",'
    '"baseRobotEnvelope":{"x":%.3f,"y":%.3f,"z":1.0}}'
)


class Poses(NamedTuple):
    """Arrays of one shape."""

    x_m: Floats
    y_m: Floats
    yaw_rad: Floats
    speed_mps: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """Straight legs between k points in time, each at an even speed. Before the first and after the last it stands."""

    t_s: Floats
    """(k,) increasing."""
    x_m: Floats
    y_m: Floats
    yaw_rad: Floats
    """(k - 1,) of each leg; of a leg on which it stands, that of the leg before."""
    speed_mps: Floats
    """(k - 1,)"""

    @classmethod
    def through(cls, t_s: Sequence[float] | Floats, points_m: Floats, yaw_rad: float = 0.0) -> Self:
        """Through `points_m` (k, 2). `yaw_rad` is the heading before it first moves."""
        t_s, legs = np.asarray(t_s, np.float64), np.diff(points_m, axis=0)
        length_m = np.hypot(*legs.T)
        moves = np.maximum.accumulate(np.where(length_m > 0, np.arange(len(legs)), -1))
        yaws = np.where(moves < 0, yaw_rad, np.arctan2(legs[:, 1], legs[:, 0])[moves])
        return cls(t_s, points_m[:, 0], points_m[:, 1], yaws, length_m / np.diff(t_s))

    @classmethod
    def standing(cls, x_m: float, y_m: float, yaw_rad: float = 0.0) -> Self:
        return cls.through([0.0, 1.0], np.array([[x_m, y_m]] * 2), yaw_rad)

    @classmethod
    def driven(cls, points_m: Floats, speed_mps: float, begins_s: float = 0.0) -> Self:
        """Through `points_m` (k, 2), which differ, at one speed."""
        lengths_m = np.maximum(np.hypot(*np.diff(points_m, axis=0).T), 1e-3)
        return cls.through(begins_s + np.concatenate([[0.0], np.cumsum(lengths_m)]) / speed_mps, points_m)

    def at(self, t_s: Floats) -> Poses:
        """The poses at times of any shape."""
        leg = np.clip(np.searchsorted(self.t_s, t_s, side="right") - 1, 0, len(self.yaw_rad) - 1)
        is_under_way = (t_s >= self.t_s[0]) & (t_s < self.t_s[-1])
        x_m, y_m = np.interp(t_s, self.t_s, self.x_m), np.interp(t_s, self.t_s, self.y_m)
        return Poses(x_m, y_m, self.yaw_rad[leg], np.where(is_under_way, self.speed_mps[leg], 0.0))


@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """One robot of a floor. Times are seconds since its start."""

    name: str
    maker: str
    source: str
    """The address of its connection."""
    way: Way
    length_m: float
    width_m: float
    phase_s: float
    """When within a second it reports."""
    begins_s: float = 0.0
    """From when on it reports."""
    silent: tuple[Span, ...] = ()
    says: Says = "path"
    is_honest: bool = False

    @property
    def uuid(self) -> str:
        return str(uuid5(NAMESPACE_DNS, self.name))

    def reports_s(self, seconds: float) -> Floats:
        """(m,) when it reports, up to `seconds`."""
        t_s = np.arange(np.ceil(self.begins_s - self.phase_s), seconds) + self.phase_s
        is_heard = np.ones(len(t_s), bool)
        for begin_s, end_s in self.silent:
            is_heard &= (t_s < begin_s) | (t_s >= end_s)
        return t_s[is_heard]

    def forecasts(self, t_s: Floats) -> Poses:
        """(m, 11) what its reports at `t_s` (m,) say: the present pose, and one for each second ahead."""
        ahead_s = np.arange(PATH_S + 1.0)
        if self.says == "path":
            return self.way.at(t_s[:, None] + ahead_s)
        now = Poses(*(column[:, None] for column in self.way.at(t_s)))
        if self.says == "bound":
            left_m = np.hypot(DOCK_M[0] - now.x_m, DOCK_M[1] - now.y_m)
            share = np.minimum(WAITS_MPS * ahead_s / np.maximum(left_m, WAITS_MPS), 1.0)
            x_m, y_m = (at_m + share * (dock_m - at_m) for at_m, dock_m in zip(now[:2], DOCK_M, strict=True))
            return Poses(*np.broadcast_arrays(x_m, y_m, now.yaw_rad, now.speed_mps))
        path_mps = {"straight": now.speed_mps, "waits": np.maximum(now.speed_mps, WAITS_MPS)}.get(self.says, 0.0)
        gone_m = path_mps * ahead_s
        x_m, y_m = now.x_m + gone_m * np.cos(now.yaw_rad), now.y_m + gone_m * np.sin(now.yaw_rad)
        return Poses(*np.broadcast_arrays(x_m, y_m, now.yaw_rad, now.speed_mps))


class Sent(NamedTuple):
    """A message, and when it arrives, seconds since the start of the floor."""

    at_s: float
    robot: int
    raw: bytes


def sent_by(robots: Sequence[Robot], seconds: float, start_s: int = START_S) -> list[Sent]:
    """All messages of robots, by arrival; `robot` is the index. Second 0 is `start_s` since the epoch."""
    sent = [each for number, robot in enumerate(robots) for each in _messages(number, robot, seconds, start_s)]
    return sorted(sent, key=lambda each: each.at_s)


def _messages(number: int, robot: Robot, seconds: float, start_s: int) -> Iterator[Sent]:
    uuid, reports_s = robot.uuid, robot.reports_s(seconds)
    if not len(reports_s):
        return
    sizes = robot.length_m, robot.width_m
    identity = _IDENTITY % (uuid, stamp(start_s + reports_s[0]), robot.maker, robot.name, *sizes)
    yield Sent(float(reports_s[0]), number, identity.encode())
    poses = robot.forecasts(reports_s)
    rows = zip(reports_s.tolist(), *(column.tolist() for column in poses), strict=True)
    for t_s, x_m, y_m, yaw_rad, speeds in rows:
        path, state = "", "idle"
        if robot.says == "speed" and speeds[0] > 0:
            state = "navigating"
        elif robot.says == "bound":
            path, state = _bound(start_s + t_s, x_m[0], y_m[0]), "navigating"
        elif robot.says in ("path", "straight", "waits") and (speeds[0] > 0 or x_m[0] != x_m[-1] or y_m[0] != y_m[-1]):
            points = (
                _POINT % (stamp(start_s + t_s + k), x_m[k], y_m[k], sin(yaw_rad[k] / 2), cos(yaw_rad[k] / 2), HALL)
                for k in range(1, PATH_S + 1)
            )
            path, state = f',"path":[{",".join(points)}]', "navigating"
        here = x_m[0], y_m[0], sin(yaw_rad[0] / 2), cos(yaw_rad[0] / 2)
        yield Sent(t_s, number, (_STATUS % (uuid, stamp(start_s + t_s), state, *here, HALL, speeds[0], path)).encode())


def _bound(now_s: float, x_m: float, y_m: float) -> str:
    """The destination of a robot that goes to the dock."""
    arrives_s = now_s + hypot(DOCK_M[0] - x_m, DOCK_M[1] - y_m) / WAITS_MPS
    return f',"destinations":[{_POINT % (stamp(arrives_s), *DOCK_M, 0.0, 1.0, HALL)}]'
