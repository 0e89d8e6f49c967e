"""A robot's identity report as one ingest hands it to another, which the robot has not told of itself."""

from base64 import b64decode, b64encode
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class Introduction:
    """What a robot said of itself, when that arrived, and for whom it was said."""

    uuid: str
    raw: bytes
    arrival_s: float
    vendor: str | None
    """Of the connection that it came over, where that tells."""
    owner: str
    """Whose robot it was from then on."""
    assigned: bool = False
    """Whether the site file gives the robot to its owner."""
    elsewhere: bool = field(default=False, compare=False)
    """Whether it came to another ingest."""

    @classmethod
    def of_document(cls, document: dict[str, Any]) -> "Introduction":
        return cls(**document | {"raw": b64decode(document["raw"])}, elsewhere=True)

    def document(self) -> dict[str, Any]:
        """JSON-ready."""
        return {
            "uuid": self.uuid,
            "raw": b64encode(self.raw).decode(),
            "arrival_s": self.arrival_s,
            "vendor": self.vendor,
            "owner": self.owner,
            "assigned": self.assigned,
        }

    def is_news_to(self, known: "Introduction | None") -> bool:
        """Whether it was said after what is known, is something else, and is not another vendor's word on its robot."""
        if known is None:
            return True
        may_say = self.owner == known.owner or self.assigned
        return may_say and self.arrival_s > known.arrival_s and self.raw != known.raw
