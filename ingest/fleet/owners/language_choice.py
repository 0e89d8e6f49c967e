"""Which language of a robot is heard, if it speaks several: the one that was heard first, until that falls silent.

A robot that reports in two languages would be two robots in the same place. It is recognised by its UUID, or by its
vendor and serial number.
"""

from collections import OrderedDict
from collections.abc import Iterable

from ingest.fleet.robot import Robot
from ingest.languages.model import Rejection

MOST_SECONDS = 20_000
"""UUIDs kept that are known as the second language of a robot."""
MOST_SERIALS = 2
"""Serial numbers kept of a robot: that of its topic and that of its identity, or of its vendor before."""
RULE = "robot-in-two-languages"
VendorSerial = tuple[str, str]
"""A vendor, and a serial number, case folded."""


class LanguageChoice:
    """The robots by vendor and serial number."""

    def __init__(self) -> None:
        self._by_serial: dict[VendorSerial, Robot] = {}
        self._serials: dict[str, tuple[VendorSerial, ...]] = {}
        """By UUID of a robot, its `MOST_SERIALS` newest ones."""
        self._seconds: OrderedDict[str, Robot] = OrderedDict()
        """By UUID in a second language, the robot that it is in the first."""
        self._seconds_of: dict[str, set[str]] = {}
        """The reverse: by UUID of a robot, its UUIDs in a second language."""

    def note(self, robot: Robot) -> None:
        """Note the serial number of a robot that is heard."""
        serial = robot.identity.serial if robot.identity else robot.serial
        if not serial.strip():
            return
        newest, before = (robot.vendor, serial.casefold()), self._serials.get(robot.uuid, ())
        kept = (newest, *(known for known in before if known != newest))[:MOST_SERIALS]
        self._forget_serials(robot, set(before).difference(kept))
        self._serials[robot.uuid], self._by_serial[newest] = kept, robot

    def remove(self, robot: Robot) -> None:
        """Forget a robot that is kept no longer."""
        self._forget_serials(robot, self._serials.pop(robot.uuid, ()))
        for uuid in self._seconds_of.pop(robot.uuid, ()):
            del self._seconds[uuid]

    def _forget_serials(self, robot: Robot, serials: Iterable[VendorSerial]) -> None:
        for known in serials:
            if self._by_serial.get(known) is robot:
                del self._by_serial[known]

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
        self._seconds_of.setdefault(chosen.uuid, set()).add(uuid)
        if len(self._seconds) > MOST_SECONDS:
            oldest, known = self._seconds.popitem(last=False)
            self._seconds_of[known.uuid].discard(oldest)
        return Rejection(RULE, f"{chosen.name} is heard in {chosen.language} already; send one language")

    def _same_robot(self, robot: Robot | None, language: str, vendor: str | None, serial: str) -> Robot | None:
        """The robot that a message is about, under this UUID or another."""
        if robot and robot.language != language:
            return robot
        return self._by_serial.get((vendor, serial.casefold())) if vendor and serial.strip() else None
