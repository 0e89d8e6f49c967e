"""What people are shown of robots that are off the floor, that came back, and that were moved by hand."""

from typing import Any

from ingest.fleet.owners.departures import OffFloor
from ingest.fleet.robot import Robot
from ingest.recording.operator_events import OffFloorMark

BACK_SHOWN_S = 600.0
"""A robot that came back by itself is listed for so long."""


def mark_document(mark: OffFloorMark, robot: Robot | None, now_s: float) -> dict[str, Any]:
    """What was said of a robot that is off the floor, JSON-ready."""
    heard_s = robot.arrival_s if robot else None
    return {
        "by": mark.by,
        "at_s": mark.at_s,
        "floor": mark.datum or None,
        "x": round(mark.x_m, 3),
        "y": round(mark.y_m, 3),
        "still_heard": heard_s is not None and heard_s > mark.at_s,
        "age_s": None if heard_s is None else round(now_s - heard_s, 3),
    }


def robot_parts(off_floor: OffFloor, robot: Robot, now_s: float) -> dict[str, Any]:
    """The parts of a robot's document."""
    mark, moved = off_floor.marks.get(robot.uuid), robot.moved
    return {
        "off_floor": mark_document(mark, robot, now_s) if mark else None,
        "moved": moved._asdict() | {"sentence": moved.sentence} if moved else None,
    }


def listed(off_floor: OffFloor, robots: dict[str, Robot], now_s: float) -> list[dict[str, Any]]:
    """The robots that are off the floor, and those that came back by themselves lately: then `back_s` is when."""
    rows = [_row(uuid, mark, robots.get(uuid), now_s, None) for uuid, mark in off_floor.marks.items()]
    back = [
        _row(uuid, mark, robots.get(uuid), now_s, mark.at_s)
        for uuid, mark in off_floor.back.items()
        if now_s - mark.at_s <= BACK_SHOWN_S
    ]
    return [*rows, *back]


def _row(uuid: str, mark: OffFloorMark, robot: Robot | None, now_s: float, back_s: float | None) -> dict[str, Any]:
    named = {"uuid": uuid, "name": robot.name if robot else uuid[:8], "vendor": robot.vendor if robot else ""}
    return named | mark_document(mark, robot, now_s) | {"back_s": back_s}
