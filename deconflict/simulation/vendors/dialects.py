"""The dialect of each vendor: converts a robot's state to the bytes that it sends.

Alder conforms, except that its clock is 3 s fast. Corvid sends like the standard's official sample sender. Basalt uses
its own map. Walkers are devices of people; most of them know no path.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from math import cos, floor, radians, sin
from typing import Any

import numpy as np

from deconflict.simulation.participants import VendorName
from deconflict.simulation.robot_state import RobotState
from ingest.batch import Floats

GROUND_ID = "7d2b1c8e-3f64-4a95-9c1d-5e8f20a6b301"
MEZZANINE_ID = "7d2b1c8e-3f64-4a95-9c1d-5e8f20a6b302"
EVERY_SECOND_S = tuple(float(second) for second in range(1, 11))
EVERY_TWO_S = tuple(2.0 * second for second in EVERY_SECOND_S)
"""Short enough that straight lines between the points do not cut corners."""
FULL_RUN_H = 8.0
"""How long a full battery lasts."""
PEOPLE_PER_PATH = 3
"""One in this many people has a device that knows its path."""


@dataclass(frozen=True, slots=True)
class DialectMap:
    """A vendor's frame of a floor: its datum, and the floor's frame rotated and then shifted."""

    datum: str
    turn_rad: float = 0.0
    shift_m: tuple[float, float] = (0.0, 0.0)

    def pose(self, x_m: float, y_m: float, yaw_rad: float) -> tuple[float, float, float]:
        c, s = cos(self.turn_rad), sin(self.turn_rad)
        return (
            c * x_m - s * y_m + self.shift_m[0],
            s * x_m + c * y_m + self.shift_m[1],
            yaw_rad + self.turn_rad,
        )


def _to_the_millisecond(t_s: float) -> str:
    return datetime.fromtimestamp(t_s, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _to_the_second(t_s: float) -> str:
    return datetime.fromtimestamp(floor(t_s), UTC).strftime("%Y-%m-%dT%H:%M:%S+0000")


@dataclass(frozen=True, slots=True, eq=False)
class Dialect:
    """How one vendor encodes its messages."""

    maps: tuple[DialectMap, DialectMap]
    """The map of each floor."""
    clock_fast_s: float = 0.0
    stamp: Callable[[float], str] = _to_the_millisecond
    resolution_s: float = 0.0
    """Resolution of timestamps. The points of a path are correct at the times that are sent."""
    uuid_text: Callable[[str], str] = str
    """How UUIDs are written."""
    path_s: tuple[float, ...] = EVERY_SECOND_S
    """Times ahead of the points of a path."""
    path_datum_key: str = "planarDatumUUID"
    path_names_datum: bool = False
    """Whether each point names its datum even if it is the robot's own."""

    def messages(self, robot: RobotState, now_s: float, *, introduce: bool = False) -> list[bytes]:
        """The messages at `now_s`, seconds since the epoch: the status; with `introduce` the identity before it."""
        reports = [self.identity(robot, now_s)] if introduce else []
        return [json.dumps(report, separators=(",", ":")).encode() for report in (*reports, self.status(robot, now_s))]

    def identity(self, robot: RobotState, now_s: float) -> dict[str, Any]:
        make, member = robot.member.make, robot.member
        report = {
            "uuid": self.uuid_text(member.uuid),
            "timestamp": self.stamp(now_s + self.clock_fast_s),
            "manufacturerName": make.vendor.value,
            "robotModel": make.model,
            "robotSerialNumber": f"{make.model}-{member.number:04}",
            "baseRobotEnvelope": {"x": make.body.length_m, "y": make.body.width_m, "z": make.height_m},
        }
        if make.person:
            return report
        return report | {
            "maxSpeed": make.max_speed_mps,
            "maxRunTime": 8.0,
            "chargerType": f"{make.vendor.value} contact plate",
            "supportVendorName": make.vendor.value,
            "cargoType": "pallet" if make.height_m > 1 else "tote",
            "cargoMaxVolume": {"x": 1.2, "y": 0.8, "z": 1.0},
            "cargoMaxWeight": "400",
        }

    def status(self, robot: RobotState, now_s: float) -> dict[str, Any]:
        x, y, yaw = self.maps[robot.floor].pose(robot.x_m, robot.y_m, robot.yaw_rad)
        here = {"x": round(x, 4), "y": round(y, 4), "angle": _angle(yaw)}
        report: dict[str, Any] = {
            "uuid": self.uuid_text(robot.member.uuid),
            "timestamp": self.stamp(now_s + self.clock_fast_s),
            "operationalState": robot.state,
            "location": here | {"planarDatum": self.uuid_text(self.maps[robot.floor].datum)},
            "velocity": {"linear": round(robot.linear_mps, 3), "angular": _angle(robot.turn_radps)},
            "batteryPercentage": round(robot.battery_pct, 1),
        }
        if not robot.member.make.person:
            report["remainingRunTime"] = round(FULL_RUN_H * robot.battery_pct / 100, 2)
            report["loadPercentageStillAvailable"] = round(100.0 - robot.load_pct, 1)
        if robot.errors:
            report["errorCodes"] = list(robot.errors)
        if robot.destinations and not robot.member.make.person:
            report["destinations"] = [
                self._point(now_s + after_s, robot.floor, floor_there, np.array(pose))
                for after_s, floor_there, *pose in robot.destinations
            ]
        if _knows_its_path(robot):
            report["path"] = self._path(robot, now_s)
        return report

    def _path(self, robot: RobotState, now_s: float) -> list[dict[str, Any]]:
        sent_s = floor(now_s / self.resolution_s) * self.resolution_s if self.resolution_s else now_s
        times_s = sent_s + np.array(self.path_s)
        poses, floors = robot.plan.at(times_s - now_s)
        return [
            self._point(float(t_s), robot.floor, int(there), pose)
            for t_s, there, pose in zip(times_s, floors, poses, strict=True)
        ]

    def _point(self, t_s: float, own_floor: int, floor_there: int, pose: Floats) -> dict[str, Any]:
        x, y, yaw = self.maps[floor_there].pose(*pose.tolist())
        point = {
            "timestamp": self.stamp(t_s + self.clock_fast_s),
            "x": round(x, 4),
            "y": round(y, 4),
            "angle": _angle(yaw),
        }
        if self.path_names_datum or floor_there != own_floor:
            point[self.path_datum_key] = self.uuid_text(self.maps[floor_there].datum)
        return point


def _knows_its_path(robot: RobotState) -> bool:
    person = robot.member.make.person
    return robot.state == "navigating" and (not person or robot.member.number % PEOPLE_PER_PATH == 0)


def _angle(yaw_rad: float) -> dict[str, float]:
    """An angle as a quaternion. A turn rate in radians per second is encoded as the rotation in one second."""
    return {"x": 0.0, "y": 0.0, "z": round(sin(yaw_rad / 2), 6), "w": round(cos(yaw_rad / 2), 6)}


SITE_MAPS = (DialectMap(GROUND_ID), DialectMap(MEZZANINE_ID))
BASALT_MAPS = (
    DialectMap("c19e4f70-8a2d-4b36-b5f1-04d7e6a9c801", radians(27.3), (112.4, -38.7)),
    DialectMap("c19e4f70-8a2d-4b36-b5f1-04d7e6a9c802", radians(-61.8), (-14.9, 220.3)),
)
DIALECTS = {
    VendorName.ALDER: Dialect(SITE_MAPS, clock_fast_s=3.0),
    VendorName.CORVID: Dialect(
        SITE_MAPS,
        stamp=_to_the_second,
        resolution_s=1.0,
        uuid_text=str.upper,
        path_s=EVERY_TWO_S,
        path_datum_key="planarDatum",
        path_names_datum=True,
    ),
    VendorName.BASALT: Dialect(BASALT_MAPS),
    VendorName.WALKERS: Dialect(SITE_MAPS),
}
