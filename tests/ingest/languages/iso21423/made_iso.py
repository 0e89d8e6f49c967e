"""Reads messages of ISO 21423 one after the other, with the memory of one robot."""

from ingest.languages.iso21423.iso_front_end import IsoFrontEnd
from ingest.languages.iso21423.iso_memory import IsoMemory
from ingest.languages.model import Message, Status
from tests.helpers.iso_saying import topic

T = 1_790_000_000.0


class IsoListener:
    """The memory of one robot, and what its last message said."""

    def __init__(self) -> None:
        self.memory: IsoMemory | None = None
        self.front_end = IsoFrontEnd()

    def hears(self, resource: str, raw: bytes) -> Message:
        message, self.memory = self.front_end.read(raw, topic(resource), self.memory, None)
        return message

    def status_after(self, *messages: tuple[str, bytes]) -> Status:
        """The robot's status after the given messages: of the last one, or derived again from its memory."""
        for resource, raw in messages:
            last = self.hears(resource, raw)
        status = last if isinstance(last, Status) else self.front_end.status(b"", self.memory, None)
        assert status is not None
        return status
