"""What the fleet asks of a fast path. `ingest/fast_path` has one; without it the fleet reads the same, but slower."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from ingest.fleet.robot import Robot
from ingest.languages.model import Rejection, Status
from ingest.port.connection import Connection


class ScannedStatus(Protocol):
    """A status whose bytes were scanned, and which is not built yet."""

    @property
    def raw(self) -> bytes: ...

    @property
    def uuid(self) -> bytes:
        """As it was sent."""

    @property
    def texts(self) -> object:
        """The same object for all statuses with the same state, datums and findings on them."""

    @property
    def stamp_s(self) -> float: ...

    @property
    def stamp_resolution_s(self) -> float: ...

    def message(self, names_as_uuid: str | None) -> Status | Rejection:
        """What `parser.read` gives for it."""


Scanned = TypeVar("Scanned", bound=ScannedStatus)
Read_contra = TypeVar("Read_contra", bound=ScannedStatus, contravariant=True)


class RepeatReader(Protocol[Read_contra]):
    """Reads the statuses of one robot that differ from its last only in motion."""

    @property
    def robot(self) -> Robot: ...

    @property
    def connection(self) -> Connection: ...

    @property
    def texts(self) -> object:
        """Those of the statuses that it reads."""

    def is_valid(self, connection: Connection) -> bool:
        """Whether the robot still reports over this connection and is read by the same settings."""

    def read(self, scanned: Read_contra, event_s: float) -> tuple[str, ...] | None:
        """Update the robot and its forecast. Returns the findings; None, and no change, for any other status."""


@dataclass(frozen=True, slots=True)
class FastPath(Generic[Scanned]):
    """Compiled shortcuts."""

    scan: Callable[[bytes], Scanned | None]
    """A plain status from its bytes; None for any other message."""
    repeat_reader: Callable[[Robot, Scanned, Connection, str | None], RepeatReader[Scanned] | None]
    """For a robot whose last status was scanned; None where each of its statuses has to be read in full."""
