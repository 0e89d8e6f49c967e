"""The fast path's readers of repeated statuses, one for each robot whose last status was plain."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from ingest.fleet.robot import Robot
from ingest.port.connection import Connection

if TYPE_CHECKING:  # a receiver starts without numba
    from ingest.fast_path.status_scanner import ScannedStatus
    from ingest.fleet.repeat_status import FastPath, RepeatReader


class RepeatReaders:
    """Finds the reader of a scanned status by the UUID as it was sent."""

    def __init__(self, fast_path: "FastPath", names_as_uuid: Callable[[Connection], str | None]) -> None:
        """`names_as_uuid` is that of `RobotOwners`."""
        self.scan = fast_path.scan
        self._new_reader, self._names_as_uuid = fast_path.repeat_reader, names_as_uuid
        self._readers: dict[bytes, RepeatReader] = {}
        """By a robot's UUID as sent."""

    def find(self, scanned: "ScannedStatus", connection: Connection) -> "RepeatReader | None":
        """The reader of the robot's repeated statuses. None if the status has to be read in full.

        If only the texts of the status have changed, the reader is replaced.
        """
        reader = self._readers.get(scanned.uuid)
        if reader is None or not reader.is_valid(connection):
            return None
        if reader.texts is scanned.texts:
            return reader
        return self.replace(reader.robot, scanned, connection)

    def replace(self, robot: Robot, scanned: "ScannedStatus", connection: Connection) -> "RepeatReader | None":
        """Prepare a new reader from the robot's newest status. None if each of its statuses has to be read in full."""
        self.remove(robot)
        reader = self._new_reader(robot, scanned, connection, self._names_as_uuid(connection))
        if reader:
            robot.uuid_as_sent = scanned.uuid
            self._readers[robot.uuid_as_sent] = reader
        return reader

    def remove(self, robot: Robot) -> None:
        """Remove the robot's reader, if it has one."""
        if robot.uuid_as_sent:
            self._readers.pop(robot.uuid_as_sent, None)
            robot.uuid_as_sent = b""
