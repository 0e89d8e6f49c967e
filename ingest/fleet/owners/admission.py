"""Which new robots are examined: compared with all others, for conflicts.

A sender can invent robots without end, and each costs work for each robot near it. So new robots of a source that
proves nothing (`ingest/port/connection.py`) are examined at a limited rate once the floor is known:

- At once: robots that `vendors.robots` names, and those of proven vendors (credentials, a dialled address, a
  manufacturer that the site file names).
- At once, too, while a floor starts that knew no robot: until none has come for `SETTLED_S`, or `STARTS_S` are over.
  Not so robots of manufacturers that only a topic names.
- Else each source may bring `FEWEST` new robots a minute, or `SHARE` of those that are examined if that is more.
  Further robots wait in the order in which they came. A place that becomes free is the robot's with its next message.

A robot that is examined stays so for as long as the fleet knows it, and over restarts. A waiting one is placed,
forecast and shown like any other.
"""

from collections import Counter, OrderedDict, deque
from collections.abc import Collection
from dataclasses import dataclass, field
from math import inf

from ingest.fleet.robot import Robot
from ingest.languages.model import Rejection
from ingest.port.connection import BROKER, Connection

UNEXAMINED, PARTLY_EXAMINED = "deconflict_robots_unexamined", "deconflict_robots_partly_examined"
MOST_NAMED, OTHERS = 10, "other sources"
OF_TOPICS = "name its manufacturer or its robots in the vendors of the site file"
OF_SOCKETS = "give its vendor a token or a certificate, or list its robots in vendors.robots of the site file"
SETTLED_S, STARTS_S = 60.0, 300.0
FEWEST, SHARE = 20, 0.05
MINUTE_S = 60.0
MOST_WAITING = 2000
"""Robots of one source that may wait. Further ones are refused, since each takes memory and work to show."""
MOST_SOURCES = 1000
"""Sources whose newest robots are kept. Beyond it, those without any in the last minute are forgotten."""


@dataclass(slots=True, eq=False)
class _Newcomers:
    """The new robots of one source."""

    waiting: OrderedDict[str, None] = field(default_factory=OrderedDict)
    """The UUIDs of those that have no place, in order of arrival. The values are unused."""
    placed: set[str] = field(default_factory=set)
    """The UUIDs of those that have a place, and are examined with their next message."""
    placed_s: deque[float] = field(default_factory=deque)
    """When the places of the last minute were given."""


class Admission:
    """Decides with each message of a robot that is not examined yet. `now_s` is the message's arrival."""

    def __init__(self) -> None:
        self.examined = 0
        """How many robots are examined."""
        self.recorded: bool | None = None
        """In a replay: whether the robot of the message that is read was examined. None: the rules decide."""
        self._newcomers: dict[str, _Newcomers] = {}
        """By source."""
        self._source_of: dict[str, str] = {}
        """By UUID of a robot that is not examined."""
        self.waiting: Counter[str] = Counter()
        """How many robots of each source are not examined."""
        self._first_s, self._newest_s = -inf, -inf
        """When the floor started, and when it last took in a robot because it starts."""

    def level(self) -> dict[tuple[str, ...], float]:
        """How many robots are not examined, by source: those with most by name, the rest together."""
        named = self.waiting.most_common(MOST_NAMED)
        if rest := self.waiting.total() - sum(count for _, count in named):
            named.append((OTHERS, rest))
        return {(source,): count for source, count in named}

    def rejection(self, connection: Connection, *, is_named: bool) -> Rejection | None:
        """Why no further robot of the source may wait. None if it may, or if it need not."""
        is_known = is_named or connection.proven or self.recorded is not None
        if is_known or self.waiting[connection.source] < MOST_WAITING:
            return None
        wait = f"{MOST_WAITING} robots of {connection.source} wait to be examined"
        return Rejection("robots-too-many", f"{wait}; {remedy([connection.source])}")

    def consider(self, robot: Robot, connection: Connection, now_s: float, *, is_named: bool) -> None:
        """Examine the robot from now on, or let it wait. `is_named`: whether the site file names it."""
        if self._source_of.get(robot.uuid) != connection.source:
            self.forget(robot)
            self._source_of[robot.uuid] = connection.source
            self.waiting[connection.source] += 1
        if self.recorded is None:
            is_known = is_named or connection.proven or self._is_start(connection, now_s)
            robot.examined = is_known or self._has_place(robot.uuid, connection.source, now_s)
        else:
            robot.examined = self.recorded
        if robot.examined:
            self._leave(robot.uuid)
            self.examined += 1

    def resume(self) -> None:
        """Robots that were known before a restart are back: the floor does not start."""
        if self.examined:
            self._first_s = -inf

    def forget(self, robot: Robot) -> None:
        """The fleet knows the robot no more."""
        self._leave(robot.uuid)
        self.examined -= robot.examined

    def _is_start(self, connection: Connection, now_s: float) -> bool:
        """Whether the floor starts, and the robot may be one of those with which it does."""
        if not self.examined:
            self._first_s = self._newest_s = now_s
        is_start = now_s - self._first_s < STARTS_S and now_s - self._newest_s < SETTLED_S
        if is_start and not (connection.topic and connection.vendor):
            self._newest_s = now_s
            return True
        return False

    def _has_place(self, uuid: str, source: str, now_s: float) -> bool:
        """Whether the robot may be examined. It waits if not."""
        newcomers = self._newcomers.get(source)
        if newcomers is None:
            if len(self._newcomers) >= MOST_SOURCES:
                self._forget_idle(now_s)
            newcomers = self._newcomers[source] = _Newcomers()
        if uuid not in newcomers.placed:
            newcomers.waiting.setdefault(uuid)
        _remove_past(newcomers.placed_s, now_s)
        most = max(FEWEST, int(SHARE * (self.examined - len(newcomers.placed_s))))
        while newcomers.waiting and len(newcomers.placed_s) < most:
            newcomers.placed.add(newcomers.waiting.popitem(last=False)[0])
            newcomers.placed_s.append(now_s)
        return uuid in newcomers.placed

    def _leave(self, uuid: str) -> None:
        """The robot waits no more."""
        source = self._source_of.pop(uuid, None)
        if source is None:
            return
        self.waiting[source] -= 1
        if not self.waiting[source]:
            del self.waiting[source]
        if newcomers := self._newcomers.get(source):
            newcomers.waiting.pop(uuid, None)
            newcomers.placed.discard(uuid)

    def _forget_idle(self, now_s: float) -> None:
        for source, newcomers in list(self._newcomers.items()):
            _remove_past(newcomers.placed_s, now_s)
            if not (newcomers.waiting or newcomers.placed or newcomers.placed_s):
                del self._newcomers[source]


def remedy(sources: Collection[str]) -> str:
    """What to do so that robots of these sources need not wait. A manufacturer proves something of topics only."""
    topics = sum(source.partition(" ")[0] == BROKER for source in sources)
    if topics in (0, len(sources)):
        return OF_TOPICS if topics else OF_SOCKETS
    return f"of a broker, {OF_TOPICS}; of others, {OF_SOCKETS}"


def _remove_past(times_s: deque[float], now_s: float) -> None:
    """Remove the times that are not of the last minute; the clock may have been put back."""
    while times_s and not 0.0 <= now_s - times_s[0] < MINUTE_S:
        times_s.popleft()
