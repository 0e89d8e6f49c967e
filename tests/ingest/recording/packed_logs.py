"""Logs whose older segments are packed, for tests."""

from collections.abc import Iterable
from itertools import count
from math import cos, sin
from pathlib import Path
from random import Random

from ingest.recording.log_reader import Tick
from ingest.recording.log_segments import PACKED
from ingest.recording.recorder import Recorder
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import points, status
from tests.ingest.recording.made_logs import LINE, NOW_S, read, recorder


def ticks(directory: Path, seconds: Iterable[int], writer: Recorder | None = None) -> None:
    """Record ticks at some seconds, 3 to a segment. What is due is packed before the next one."""
    writer = writer or recorder(directory, segment_bytes=100)[0]
    for second in seconds:
        writer.tick(NOW_S + second)
        assert writer.sync()
        settle(writer)
    writer.close()


def settle(writer: Recorder) -> None:
    """Wait until what is due is packed."""
    writer.files.packer.close(PATIENCE_S)


def seconds(*paths: Path) -> list[int]:
    """Those of the ticks in a log, as they are read."""
    return [round(event.now_s - NOW_S) for event in read(*paths)[0] if isinstance(event, Tick)]


def names(directory: Path) -> list[str]:
    """`plain` or `packed` of each segment by age, and what else is in a directory of a log."""
    kinds = {".jsonl": "plain", PACKED: "packed"}
    return [kinds.get(file.suffix, file.name) for file in sorted(directory.iterdir())]


def drives(directory: Path, robots: int, segments: int) -> list[bytes]:
    """Record robots on drawn courses until there are so many segments. Returns the messages."""
    writer, random, sent = recorder(directory, segment_bytes=200_000)[0], Random(1), list[bytes]()
    courses = [(f"A-{robot}", random.uniform(5, 50), random.uniform(0.02, 0.1)) for robot in range(robots)]
    for second in count():
        now_s = NOW_S + second
        for name, radius_m, turn in courses:
            places = [
                (now_s + ahead, radius_m * cos(turn * (second + ahead)), radius_m * sin(turn * (second + ahead)), 0.1)
                for ahead in range(11)
            ]
            sent.append(status(name, now_s, *places[0][1:], path=points(*places[1:])))
            writer.received(sent[-1], now_s, LINE, None)
        writer.tick(now_s)
        assert writer.sync()
        settle(writer)
        if len(list(directory.iterdir())) == segments:
            writer.close()
            return sent
    raise AssertionError
