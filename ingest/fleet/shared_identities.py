"""Identity reports that ingests pass on to one another.

A robot that moves to another ingest may not send its identity report there again.
"""

from base64 import b64decode, b64encode
from dataclasses import asdict, dataclass, field
from typing import Any

from ingest.languages.front_ends import MASSROBOTICS
from ingest.languages.model import Identity
from ingest.port.connection import Connection

INTRODUCER = "another ingest"
"""Recorded as the peer of an identity report that came from another ingest."""


@dataclass(frozen=True, slots=True)
class SharedIdentity:
    """An identity report, and how it arrived."""

    uuid: str
    raw: bytes
    """The message."""
    arrival_s: float
    vendor: str | None
    """Vendor of the connection over which it came; None if it had none."""
    owner: str
    """The robot's vendor from then on."""
    assigned: bool = False
    """Whether the site file assigns the robot to its owner."""
    language: str = MASSROBOTICS
    topic: str = ""
    """The topic of a broker on which it came; "" for a socket."""
    elsewhere: bool = field(default=False, compare=False)
    """Whether it arrived at another ingest."""

    @classmethod
    def received(
        cls, identity: Identity, raw: bytes, arrival_s: float, connection: Connection, owner: str, assigned: bool
    ) -> "SharedIdentity":
        """The report that came over a connection."""
        sender = connection.vendor, owner, assigned, connection.language, connection.topic
        return cls(identity.uuid, raw, arrival_s, *sender, elsewhere=connection.peer == INTRODUCER)

    @classmethod
    def of_document(cls, document: dict[str, Any]) -> "SharedIdentity":
        return cls(**document | {"raw": b64decode(document["raw"])}, elsewhere=True)

    def document(self) -> dict[str, Any]:
        """JSON-ready."""
        document = asdict(self) | {"raw": b64encode(self.raw).decode()}
        del document["elsewhere"]
        return document

    def is_sent_as(self, known: "SharedIdentity") -> bool:
        """Whether the known report came for the same vendor, in the same language and on the same topic."""
        return (self.vendor, self.language, self.topic) == (known.vendor, known.language, known.topic)

    def is_news_to(self, known: "SharedIdentity | None") -> bool:
        """Whether it is newer than the known report, differs from it, and its vendor may report the robot."""
        if known is None:
            return True
        may_report = self.owner == known.owner or self.assigned
        return may_report and self.arrival_s > known.arrival_s and self.raw != known.raw
