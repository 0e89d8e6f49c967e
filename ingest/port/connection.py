"""The sender at the other end of a socket, as parts without sockets see it."""

from dataclasses import dataclass

from ingest.languages.front_ends import MASSROBOTICS

KEPT = -1
"""The number of the connection of messages that were kept for a restart."""


@dataclass(frozen=True, slots=True)
class Connection:
    """One connection of a robot, a fleet manager or a person's device."""

    id: int
    """Unique within a log, across restarts of the receiver."""
    peer: str = ""
    """Address of the sender."""
    path: str = "/"
    """Path of the URL, which may name a vendor."""
    vendor: str | None = None
    """The vendor for which the connection speaks, by its path or the dialled address. None if neither says it."""
    language: str = MASSROBOTICS
    """The key in `ingest.languages.front_ends.FRONT_ENDS` of the messages that come over it."""
    topic: str = ""
    """The topic of a broker; "" for a socket. Each topic counts as a connection of its own."""

    @property
    def settles_owners(self) -> bool:
        """Whether a robot belongs to the vendor that its messages name.

        False for messages that were kept for a restart: the site file may name other vendors now.
        """
        return self.id != KEPT
