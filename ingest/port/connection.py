"""The sender at the other end of a socket, as parts without sockets see it."""

from dataclasses import dataclass


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
