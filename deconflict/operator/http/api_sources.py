"""What the HTTP application asks of the other roles."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict_client.answers.loss_models import LossList
from ingest.batch import Batch
from ingest.recording.operator_events import OffFloorMark

Document = dict[str, Any]
Exposition = Callable[[list[Document]], tuple[bytes, str]]
"""From documents of `Measures.as_document()` to the text of a scrape and its content type."""


class SourceUnavailableError(Exception):
    """A role does not answer."""

    def __init__(self, role: str) -> None:
        super().__init__(f"the {role} does not answer")
        self.role = role


class FloorSource(Protocol):
    """What the page's routes need of the other roles."""

    async def follow(self, number: int) -> tuple[int, bool, Batch | None]:
        """See `live_socket.Follow`. Raises `ConnectionError`."""

    async def live_status(self) -> Document:
        """The state of the roles, the vendors and the silent robots, and the unidentified robots. Never raises."""

    async def floor_at(self, at_s: float) -> str:
        """The floor at a time, as a frame of `FloorFrames`. Raises `SourceUnavailableError`."""

    async def recorded(self) -> tuple[float, float] | None:
        """When the recording begins and ends, seconds since the epoch; None if there is none."""

    def presence(self) -> Document:
        """Which silent robots are still there: a `StillThere`, JSON-ready."""


class Sources(FloorSource, Protocol):
    """What all routes need of the other roles. Each call raises `SourceUnavailableError` if a role does not answer."""

    async def robots(self, uuid: str = "") -> list[Document]:
        """What each robot reported and what was derived from it, with at least `uuid` and `vendor`.

        With a UUID at least that robot, if it is known.
        """

    async def give_robot(self, uuid: str, vendor: str) -> Document:
        """Let a robot belong to a vendor: `before`, its owner until now, and `problem`, why it can't be given or ""."""

    async def mark_off_floor(self, mark: OffFloorMark) -> Document:
        """Take a robot off the floor, or put it back. The mark that holds now; empty if the robot is on the floor."""

    async def quarantine(self) -> list[Document]:
        """The rejected messages that are kept."""

    async def senders(self) -> list[Document]:
        """What each vendor should mend, as `fleet_report.senders` gives it; nothing if no receiver answers."""

    async def measures(self) -> list[Document]:
        """`Measures.as_document()` of each role that answers, except the operator face."""

    async def health(self) -> Document:
        """`status`, "ok" or "degraded", and `roles`."""

    async def losses(self, question: LossQuestion) -> LossList:
        """Lost time. Raises `StoreError` if the ledger can't be read."""

    def blackboxes(self) -> list[Document]:
        """The contents of each black box, newest last. Raises `OSError`."""

    def blackbox(self, file: str) -> Path | None:
        """The path of a black box; None if there is no such box."""

    async def reload(self) -> Document:
        """Make the supervisor read the site file again. The result is a `Reloaded`, JSON-ready."""
