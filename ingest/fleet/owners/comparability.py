"""Why a robot that is heard is compared with nobody, and what its vendor should send or the site file should say."""

import json
from collections.abc import Iterator, Mapping, Set
from difflib import get_close_matches
from functools import lru_cache
from typing import Any, NamedTuple

from ingest.fleet.owners.admission import remedy
from ingest.fleet.robot import Robot
from ingest.fleet.shown.quarantine import SEVERAL
from ingest.frames.floor_index import MOST_UNKNOWN, NOWHERE
from ingest.frames.frame_registry import LONGEST_NAME
from ingest.languages.front_ends import MASSROBOTICS
from ingest.languages.rules import MOST_LETTERS, Oddity
from ingest.settings import Reading

NEW_S = 30.0
"""A robot without a position is a fault only after this time: a sender may identify its robots first."""
MOST_NAMED = 3
"""Maps and kinds of message that a sentence names."""
MOST_NEAREST = 4096
"""Maps of which the nearest one of the site file is kept."""

POSITIONS = {
    MASSROBOTICS: "status reports with `location`: x, y, angle, planarDatum",
    "vda5050": "`state` or `visualization` with `agvPosition` (3.0: `mobileRobotPosition`): x, y, theta, mapId",
    "iso21423": "`odometry` with `pose.locationPoint`: x, y, ccsId",
}
"""What has the position, by language."""
MAPS = {
    MASSROBOTICS: "location.planarDatum",
    "vda5050": "agvPosition.mapId",
    "iso21423": "pose.locationPoint.ccsId",
}
"""The key that names the map, by language; in VDA 5050 3.0 it is in `mobileRobotPosition`."""
IDENTITIES = {MASSROBOTICS: "identityReport", "vda5050": "factsheet", "iso21423": "identity"}
"""The message that says who a robot is, by language."""

NOT_READ, NO_POSITION, POSITION_STOPPED, NO_MAP, MAP_UNKNOWN, TOO_MANY_MAPS = (
    "not read",
    "no position",
    "position stopped",
    "no map",
    "map unknown",
    "too many maps",
)
REMEDIES = {
    NOT_READ: "its messages are rejected: GET /quarantine says why, and what to change",
    NO_POSITION: "let it send its position",
    POSITION_STOPPED: "let it send its position again",
    NO_MAP: 'let it name its map, or give its vendor a map with datum = "" in the site file',
    MAP_UNKNOWN: "add that map to vendors.maps or to datums in the site file",
    TOO_MANY_MAPS: "add its maps to vendors.maps in the site file",
}
"""By the code of a fault, what to do."""


class NotCompared(NamedTuple):
    """Why a robot is compared with nobody."""

    fault: str
    """One of `REMEDIES`; "" if nobody has to mend it."""
    sentence: str
    """Why, and what to send or set."""


def not_compared(
    robot: Robot, reading: Reading, site_floors: Set[str], floors: Mapping[str, int], now_s: float
) -> NotCompared | None:
    """Why the robot is compared with nobody. None if it is compared with whoever is on its floor.

    `site_floors` are those of the site file. `floors` says how many robots are on each floor.
    """
    is_heard = now_s - robot.heard_s <= reading.silent_after_s
    is_without = not (robot.seen and robot.frame) or robot.heard_s - robot.arrival_s > reading.silent_after_s
    if is_heard and is_without and robot.rejected >= SEVERAL and robot.rejected_s >= robot.arrival_s:
        return NotCompared(NOT_READ, f"{robot.rejected} messages rejected, the last: {robot.rejected_reason}")
    if not (robot.seen and robot.frame):
        return _without_position(robot, now_s, is_heard)
    if is_heard and robot.heard_s - robot.arrival_s > reading.silent_after_s:
        gap_s = now_s - robot.arrival_s
        sentence = f"its messages have had no position for {gap_s:.0f} s; send {_position(robot)}"
        return NotCompared(POSITION_STOPPED, sentence)
    why = _without_floor(robot, site_floors, floors)
    if why is None and not robot.examined:
        why = NotCompared("", unexamined_sentence(robot))
    return why if why is None or is_heard else why._replace(fault="")


def unexamined_sentence(robot: Robot) -> str:
    what = f"only some new robots of {robot.source} a minute are compared with others"
    return f"{what}; for all at once, {remedy([robot.source])}"


def _without_position(robot: Robot, now_s: float, is_heard: bool) -> NotCompared:
    is_fault = now_s - robot.came_s >= NEW_S and (
        _is_online(robot) or (is_heard and robot.heard_s - robot.came_s >= NEW_S)
    )
    heard = _kinds_heard(robot)
    what = f" (heard: {', '.join(heard)})" if heard else ""
    sentence = f"no position of it has come{what}; send {_position(robot)}"
    return NotCompared(NO_POSITION if is_fault else "", sentence)


def _without_floor(robot: Robot, site_floors: Set[str], floors: Mapping[str, int]) -> NotCompared | None:
    frame, seen = robot.frame, robot.seen
    if frame is None or seen is None:
        return None
    if len(robot.context_key[1]) > LONGEST_NAME:
        key = MAPS.get(robot.language, "its map")
        return NotCompared(NO_MAP, f"its map has a name of more than {LONGEST_NAME} letters; send a shorter `{key}`")
    if not frame.comparable:
        return NotCompared(
            NO_MAP,
            f"its position names no map; send `{MAPS.get(robot.language, 'its map')}`, "
            f'or give {robot.vendor} a map with datum = "" in vendors.maps of the site file',
        )
    named = frame.floor[:MOST_LETTERS]
    if seen.floor == NOWHERE:
        return NotCompared(
            TOO_MANY_MAPS,
            f"{robot.vendor} has named more than {MOST_UNKNOWN} maps that the site file does not have; {named!r} "
            "is not used: send few map names, or add them to vendors.maps",
        )
    if frame.known or not site_floors or floors[frame.floor] > 1:
        return None
    known = ", ".join(repr(floor) for floor in sorted(site_floors)[:MOST_NAMED])
    near = _nearest(frame.floor, frozenset(site_floors))
    meant = f"did you mean {near!r}?" if near else f"those of the site file are {known}"
    return NotCompared(
        MAP_UNKNOWN,
        f"no other robot is on its map {named!r}, which the site file does not have ({meant}); send that of "
        f"the site in `{MAPS.get(robot.language, 'its messages')}`, or add the map to vendors.maps of {robot.vendor}",
    )


def shown_by_history(robot: Robot, site_floors: Set[str]) -> Iterator[Oddity]:
    """What no message shows by itself and is so at present: an unknown map, a clock that is off, no identity."""
    counted, frame = robot.deviations, robot.frame
    if "datum-unknown" in counted and frame and frame.comparable and not frame.known:
        path, near = MAPS.get(robot.language, ""), _nearest(frame.floor, frozenset(site_floors))
        yield Oddity("datum-unknown", path, json.dumps(frame.floor)[:MOST_LETTERS], "a floor of its own", near)
    if "clock-off" in counted and robot.clock.offset_s:
        off_s = -robot.clock.offset_s
        value = f"{abs(off_s):.1f} s {'ahead' if off_s > 0.0 else 'behind'}"
        yield Oddity("clock-off", "timestamp", value, f"corrected by {robot.clock.offset_s:.1f} s")
    if "identity-missing" in counted and robot.identity is None:
        yield Oddity("identity-missing", IDENTITIES.get(robot.language, ""), "none", "the default size")


@lru_cache(maxsize=MOST_NEAREST)
def _nearest(floor: str, site_floors: frozenset[str]) -> str:
    return next(iter(get_close_matches(floor, [*site_floors], 1)), "")


def _position(robot: Robot) -> str:
    return POSITIONS.get(robot.language, "its position")


def _kinds_heard(robot: Robot) -> list[str]:
    """The kinds of message that have come of it, as its language calls them."""
    heard: Any = getattr(robot.memory, "heard", None)
    return sorted(heard) if heard else ["identity report"] if robot.identity else []


def _is_online(robot: Robot) -> bool:
    """Whether it says that it is connected, so that its silence means something."""
    return getattr(robot.memory, "connection", "") == "ONLINE"
