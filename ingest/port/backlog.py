"""The queue of messages that wait to be read. Without a queue, messages are read at once.

Of the waiting statuses of one robot over one connection only the newest is read, in the place of the first. So under
overload the service reads what is true now, and no robot waits longer than one round through all robots takes.
"""

from collections.abc import Callable
from functools import partial

from ingest.languages.front_ends import FRONT_ENDS
from ingest.port.connection import Connection
from ingest.port.rate_limits import ArrivedMessage
from ingest.port.time_slices import TimeSlices

RobotKey = tuple[int, bytes]
"""The number of a connection, and a UUID as it was sent."""


class Backlog:
    """Passes each message once, in order: to `deliver`, or to `overtaken` if a newer status has replaced it."""

    def __init__(
        self,
        slices: TimeSlices,
        deliver: Callable[[bytes, float, Connection], None],
        overtaken: Callable[[ArrivedMessage, str], None],
    ) -> None:
        """`overtaken` also gets the UUID as it was sent."""
        self._slices, self._deliver, self._overtaken = slices, deliver, overtaken
        self._newest: dict[RobotKey, ArrivedMessage] = {}
        """The waiting status of each robot."""

    def add(self, message: ArrivedMessage) -> None:
        """Deliver the message now, or let it wait."""
        if self._slices.is_free():
            self._deliver(*message)
            return
        connection = message.connection
        uuid = FRONT_ENDS[connection.language].superseded(message.raw, connection.topic)
        if uuid is None:
            self._slices.run(partial(self._deliver, *message), len(message.raw))
            return
        robot = connection.id, uuid
        older = self._newest.get(robot)
        self._newest[robot] = message
        if older is None:
            self._slices.run(partial(self._deliver_newest, robot, len(message.raw)), len(message.raw))
        else:
            self._slices.add_weight(len(message.raw) - len(older.raw))
            self._overtaken(older, uuid.decode(errors="replace"))

    def _deliver_newest(self, robot: RobotKey, first_bytes: int) -> None:
        message = self._newest.pop(robot)
        self._slices.add_weight(first_bytes - len(message.raw))
        self._deliver(*message)
