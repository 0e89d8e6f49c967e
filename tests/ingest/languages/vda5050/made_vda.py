"""Reads messages of VDA 5050 one after the other, with the memory of one robot."""

from ingest.languages.model import Message, Status
from ingest.languages.vda5050.vda_front_end import VdaFrontEnd
from ingest.languages.vda5050.vda_memory import VdaMemory
from tests.helpers.vda_saying import topic

T = 1_790_000_000.0


class Listener:
    """The memory of one robot, and what its last message said."""

    def __init__(self) -> None:
        self.memory: VdaMemory | None = None
        self.front_end = VdaFrontEnd()

    def hears(self, kind: str, raw: bytes) -> Message:
        message, self.memory = self.front_end.read(raw, topic(kind), self.memory, None)
        return message

    def status_after(self, *messages: tuple[str, bytes]) -> Status:
        """The robot's status after the given messages: of the last one, or derived again from its memory."""
        for kind, raw in messages:
            last = self.hears(kind, raw)
        status = last if isinstance(last, Status) else self.front_end.status(b"", self.memory, None)
        assert status is not None
        return status
