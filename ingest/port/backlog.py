"""Messages on their way to be read: at once while there is time, else in turn.

Of what waits only the newest status of a robot over one connection is read, in the place of the first: who is behind
reads what is true now, and however much comes, no robot waits longer than one reading of all of them takes.
"""

import re
from collections.abc import Callable
from functools import partial

from ingest.port.connection import Connection
from ingest.port.rate_limits import ArrivedMessage, uuid_in
from ingest.port.time_slices import TimeSlices

FIRST = re.compile(rb'\s*\{\s*"uuid"\s*:\s*"([^"]{1,64})"')
"""Most senders begin with the UUID, and nobody's but the robot's own stands there."""
Robot = tuple[int, bytes]
"""A connection's number, and the UUID as it was sent."""


class Backlog:
    """Hands over each message once, in order, to `deliver`, or to `overtaken` where a newer one is in its place."""

    def __init__(
        self,
        turns: TimeSlices,
        deliver: Callable[[bytes, float, Connection], None],
        overtaken: Callable[[ArrivedMessage, str], None],
    ) -> None:
        """`overtaken` is told the UUID too, as it was sent."""
        self._turns, self._deliver, self._overtaken = turns, deliver, overtaken
        self._newest: dict[Robot, ArrivedMessage] = {}

    def put(self, one: ArrivedMessage) -> None:
        if self._turns.at_once():
            self._deliver(*one)
            return
        uuid = status_of(one.raw)
        if uuid is None:
            self._turns.do(partial(self._deliver, *one), len(one.raw))
            return
        robot = one.connection.id, uuid
        older = self._newest.get(robot)
        self._newest[robot] = one
        if older is None:
            self._turns.do(partial(self._deliver_newest, robot, len(one.raw)), len(one.raw))
        else:
            self._turns.reweigh(len(one.raw) - len(older.raw))
            self._overtaken(older, uuid.decode(errors="replace"))

    def _deliver_newest(self, robot: Robot, first_bytes: int) -> None:
        one = self._newest.pop(robot)
        self._turns.reweigh(first_bytes - len(one.raw))
        self._deliver(*one)


def status_of(raw: bytes) -> bytes | None:
    """The UUID of the robot whose status this is, without parsing it; None where that can't be told for certain."""
    if b'"operationalState"' not in raw:
        return None
    if first := FIRST.match(raw):
        return first.group(1).lower()
    return uuid_in(raw) if raw.lower().count(b'"uuid"') == 1 else None
