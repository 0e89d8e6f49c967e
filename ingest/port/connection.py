"""Who is at the other end of a socket, as the pure parts see it."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Connection:
    """One connection of a robot, a fleet manager or a person's device."""

    id: int
    """Unique within a log, over all the starts of the receiver."""
    peer: str = ""
    path: str = "/"
    vendor: str | None = None
    """The vendor the connection speaks for, where its path or the address dialled says so."""
