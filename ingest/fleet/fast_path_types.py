"""The interface between the fleet and a fast path.

`ingest/fast_path` implements it. Without a fast path the fleet gives the same results, but slower.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from ingest.fleet.robot import Robot
from ingest.languages.model import Rejection, Status
from ingest.languages.rules import Oddity
from ingest.port.connection import Connection


class ScannedStatusProtocol(Protocol):
    """A status whose bytes were scanned, but for which no `Status` exists yet."""

    @property
    def raw(self) -> bytes: ...

    @property
    def uuid(self) -> bytes:
        """As it was sent."""

    @property
    def texts(self) -> object:
        """One object shared by all statuses with the same state, datums and deviations of these."""

    @property
    def stamp_s(self) -> float: ...

    @property
    def stamp_resolution_s(self) -> float: ...

    def message(self, names_as_uuid: str | None) -> Status | Rejection:
        """The same result as `parser.read`."""


Scanned = TypeVar("Scanned", bound=ScannedStatusProtocol)
Read_contra = TypeVar("Read_contra", bound=ScannedStatusProtocol, contravariant=True)


class RepeatReaderProtocol(Protocol[Read_contra]):
    """Reads the statuses of one robot that differ from its last only in motion."""

    @property
    def robot(self) -> Robot: ...

    @property
    def connection(self) -> Connection: ...

    @property
    def texts(self) -> object:
        """The texts of the statuses that it reads."""

    @property
    def oddities(self) -> tuple[Oddity, ...]:
        """The values of these texts that deviate."""

    def is_valid(self, connection: Connection) -> bool:
        """Whether the robot still reports over this connection and is read by the same settings."""

    def read(self, scanned: Read_contra, event_s: float) -> tuple[str, ...] | None:
        """Update the robot and its forecast. Returns its deviations. None, without any change, for any other status."""


@dataclass(frozen=True, slots=True)
class FastPath(Generic[Scanned]):
    """Functions that read plain messages faster than the parser."""

    scan: Callable[[bytes], Scanned | None]
    """The scanned status of a message. None for a message that is not a plain status."""
    repeat_reader: Callable[[Robot, Scanned, Connection, str | None], RepeatReaderProtocol[Scanned] | None]
    """A reader for a robot whose last status was scanned. None if each of its statuses has to be read in full.

    The arguments are the robot, its last status, the connection, and the vendor if names are read as UUIDs.
    """
