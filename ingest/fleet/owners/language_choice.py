"""Which language of a robot is heard, if it speaks several: the one that was heard first, until that falls silent.

A robot that reports in two languages would be two robots in the same place. It is recognised by its UUID, or by its
vendor and serial number.
"""

from collections import OrderedDict

from ingest.fleet.robot import Robot
from ingest.languages.model import Rejection

MOST_SECONDS = 20_000
"""UUIDs kept that are known as the second language of a robot."""
RULE = "robot-in-two-languages"


class LanguageChoice:
    """The robots by vendor and serial number."""

    def __init__(self) -> None:
        self._by_serial: dict[tuple[str, str], Robot] = {}
        """By vendor and serial number, case folded."""
        self._seconds: OrderedDict[str, Robot] = OrderedDict()
        """By UUID in a second language, the robot that it is in the first."""

    def note(self, robot: Robot) -> None:
        """Note the serial number of a robot that is heard."""
        serial = robot.identity.serial if robot.identity else robot.serial
        if serial.strip():
            self._by_serial[robot.vendor, serial.casefold()] = robot

    def remove(self, robot: Robot) -> None:
        """Forget a robot that is kept no longer."""
        for serial in {robot.serial, robot.identity.serial if robot.identity else ""}:
            if self._by_serial.get((robot.vendor, serial.casefold())) is robot:
                del self._by_serial[robot.vendor, serial.casefold()]
        self._seconds = OrderedDict((uuid, known) for uuid, known in self._seconds.items() if known is not robot)

    def rejection(
        self,
        uuid: str,
        robot: Robot | None,
        language: str,
        vendor_and_serial: tuple[str | None, str],
        heard_since_s: float,
    ) -> Rejection | None:
        """Why a message is not accepted: its robot was heard in another language since the given time.

        `robot` is the one with this UUID. The vendor is None, or the serial number empty, if the message says neither.
        """
        chosen = self._seconds.get(uuid) or self._same_robot(robot, language, *vendor_and_serial)
        if chosen is None or chosen.language == language or not chosen.arrival_s >= heard_since_s:
            return None
        self._seconds[uuid] = chosen
        if len(self._seconds) > MOST_SECONDS:
            self._seconds.popitem(last=False)
        return Rejection(RULE, f"{chosen.name} is heard in {chosen.language} already; send one language")

    def _same_robot(self, robot: Robot | None, language: str, vendor: str | None, serial: str) -> Robot | None:
        """The robot that a message is about, under this UUID or another."""
        if robot and robot.language != language:
            return robot
        return self._by_serial.get((vendor, serial.casefold())) if vendor and serial.strip() else None
