"""The sender at the other end of a socket, as parts without sockets see it."""

from dataclasses import dataclass, field

from ingest.languages.front_ends import MASSROBOTICS
from ingest.port.connection_shares import holder_of, site_of

BROKER = "broker"
"""The word with which the source of a topic begins."""
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
    proven: bool = False
    """Whether the vendor is more than a claim of the sender: credentials prove it, or the site file has the address
    that was dialled or the manufacturer of the topic."""
    source: str = field(init=False, compare=False)
    """Who is connected, as a text that no sender can multiply at will; see `_source`."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "source", _source(self))

    @property
    def holder(self) -> str:
        """To whom it counts where vendors have shares: to the vendor, but one that only a topic names to its source."""
        is_claim = bool(self.topic) and not self.proven
        return self.source if is_claim else holder_of(self.vendor, self.peer)

    @property
    def settles_owners(self) -> bool:
        """Whether a robot belongs to the vendor that its messages name.

        False for messages that were kept for a restart: the site file may name other vendors now.
        """
        return self.id != KEPT


def _source(connection: Connection) -> str:
    """Who is connected.

    That is the vendor if the connection proves it; else the address of the peer. Of a topic it is the broker, the
    prefix of the topic, which the site file chooses, and the vendor if the site file names its manufacturer. What a
    path, a topic or a report only claims counts for nothing: a sender can claim as many vendors as it likes.
    """
    if connection.topic:
        named = (connection.vendor,) if connection.proven and connection.vendor else ()
        return " ".join(filter(None, (BROKER, connection.peer, _prefix(connection.topic), *named)))
    if connection.proven and connection.vendor:
        return f"vendor {connection.vendor}"
    return site_of(connection.peer)


def _prefix(topic: str) -> str:
    """All but the three parts that name the robot and what the message is."""
    return topic.rsplit("/", 3)[0] if topic.count("/") >= 3 else ""
