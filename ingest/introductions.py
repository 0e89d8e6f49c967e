"""A robot's identity report as one ingest hands it to another, which the robot has not told of itself."""

from base64 import b64decode, b64encode
from dataclasses import dataclass
from typing import Any

from ingest.connection import Connection


@dataclass(frozen=True, slots=True)
class Introduction:
    """What a robot said of itself, when that arrived, and for whom it was said."""

    uuid: str
    raw: bytes
    arrival_s: float
    vendor: str | None = None
    """Of the connection that it came over, where that tells."""

    @classmethod
    def over(cls, connection: Connection, uuid: str, raw: bytes, arrival_s: float) -> "Introduction":
        return cls(uuid, raw, arrival_s, connection.vendor)

    @classmethod
    def of_document(cls, document: dict[str, Any]) -> "Introduction":
        return cls(document["uuid"], b64decode(document["raw"]), document["arrival_s"], document["vendor"])

    def document(self) -> dict[str, Any]:
        """JSON-ready."""
        raw = b64encode(self.raw).decode()
        return {"uuid": self.uuid, "raw": raw, "arrival_s": self.arrival_s, "vendor": self.vendor}

    def is_news_to(self, known: "Introduction | None") -> bool:
        """Whether it was said after what is known, and is something else."""
        return known is None or (self.arrival_s > known.arrival_s and self.raw != known.raw)
