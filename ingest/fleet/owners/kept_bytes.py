"""How many bytes of messages are kept for each source. A thousand large ones take more memory than all others."""

from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

import msgspec

from ingest.fleet.robot import Robot
from ingest.languages.model import Identity, Message, Rejection, Status

MOST_BYTES = 512 << 20
"""Of the robots of a source. Ten thousand that send 5 KB a message take less than half."""
FEW_BYTES = 32 << 10
"""A robot that is known and keeps no more is heard although its source has too much."""
UNMEASURED_BYTES = 16 << 10
"""What is kept of a robot is measured anew after so many bytes of messages, or an eighth of what it keeps."""

_ENCODER = msgspec.msgpack.Encoder()


class _Kept(NamedTuple):
    """What is kept of one robot."""

    source: str = ""
    measured: int = 0
    """Bytes, as last measured."""
    since: int = 0
    """Bytes of the messages that came since."""


class KeptBytes:
    """The newest messages of robots, and what languages keep of them, by the source of the last one."""

    def __init__(self) -> None:
        self._of_source: Counter[str] = Counter()
        self._of_robot: dict[str, _Kept] = {}
        """By UUID."""

    def rejection(
        self, message: Message, robot: Robot | None, raw: bytes, memory: object, source: str
    ) -> Rejection | None:
        """Why a message is too much for its source. None if it is not; then what is kept of its robot counts.

        `memory` is that of the robot after the message.
        """
        uuid = message.uuid or ""
        before = self._of_robot.get(uuid) or _Kept(source)
        since, is_full = before.since + len(raw), self._of_source[source] + len(raw) > MOST_BYTES
        if not is_full and before.source == source and since <= max(UNMEASURED_BYTES, before.measured // 8):
            self._of_robot[uuid] = before._replace(since=since)
            return None
        measured = _bytes_after(message, robot, raw, memory)
        if is_full and (robot is None or measured > max(before.measured * 9 // 8, FEW_BYTES)):
            reason = f"{MOST_BYTES >> 20} MiB of {source} are kept; send shorter messages, or of fewer robots"
            return Rejection("robots-too-many", reason, uuid)
        if is_full and measured > FEW_BYTES:
            measured = min(measured, before.measured)  # else it could grow by an eighth again and again
        self.forget([uuid])
        self._of_robot[uuid] = _Kept(source, measured)
        self._of_source[source] += measured
        return None

    def forget(self, uuids: Iterable[str]) -> None:
        """Count robots no more."""
        for uuid in uuids:
            if before := self._of_robot.pop(uuid, None):
                self._of_source[before.source] -= before.measured
                if not self._of_source[before.source]:
                    del self._of_source[before.source]


def _bytes_after(message: Message, robot: Robot | None, raw: bytes, memory: object) -> int:
    status = raw if isinstance(message, Status) else robot.status_raw if robot else b""
    known = robot.shared_identity.raw if robot and robot.shared_identity else b""
    identity = raw if isinstance(message, Identity) else known
    return len(status) + len(identity) + _size(memory)


def _size(memory: object) -> int:
    try:
        return len(_ENCODER.encode(memory))
    except (OverflowError, UnicodeEncodeError):  # a number beyond 64 bits, or half a letter
        return len(repr(memory))
