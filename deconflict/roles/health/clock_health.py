"""Whether the host's clock has leapt since the service last ran, or while it ran."""

import asyncio
import time
from pathlib import Path
from typing import Any

from deconflict.cluster.members_health import health_part
from ingest.recording.clock_notes import ClockFile, ClockNotes, clock_sentence

LOOK_EVERY_S = 5.0


class ClockHealth:
    """As the notes of the data directory say."""

    def __init__(self, data: Path) -> None:
        self.file, self._notes = ClockFile(data), ClockNotes()

    async def run(self) -> None:
        """Look again and again, until cancelled."""
        while True:
            self._notes = await asyncio.to_thread(self.file.read)
            await asyncio.sleep(LOOK_EVERY_S)

    @property
    def notice(self) -> str:
        """A sentence for people that the page shows."""
        reason = self._reason()
        return f"{reason}." if reason else ""

    def document(self) -> dict[str, Any]:
        """The part `clock` of the health."""
        return health_part([self._reason()])

    def _reason(self) -> str:
        return clock_sentence(self._notes, time.time())
