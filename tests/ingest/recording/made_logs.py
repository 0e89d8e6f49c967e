"""Logs for tests: written by a recorder whose clock is a test's own, and read back."""

from pathlib import Path

from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.recording.clock_notes import KnownTime
from ingest.recording.log_reader import Event, LogReader
from ingest.recording.recorder import Recorder, quantise
from ingest.settings import RecorderSettings

NOW_S = 1_790_000_000.123456
LINE = Connection(7, vendor="Alder")


class Clock:
    """Moves on a millisecond each time it is read."""

    def __init__(self) -> None:
        self.now_s = NOW_S

    def __call__(self) -> float:
        self.now_s = quantise(self.now_s + 1e-3)
        return self.now_s

    def known(self) -> KnownTime:
        """That this clock is right."""
        return KnownTime(self.now_s, self.now_s)


def recorder(directory: Path, **settings: int) -> tuple[Recorder, Measures]:
    measures, clock = Measures(), Clock()
    return Recorder(RecorderSettings(**settings), directory, measures, clock, clock.known), measures


def read(*paths: Path) -> tuple[list[Event], int]:
    reader = LogReader()
    return list(reader.read(paths)), reader.unreadable
