"""A short log of two robots that cross, and its scores."""

from math import pi
from pathlib import Path
from typing import Any

from deconflict.settings.site import DEFAULT, Site
from ingest.languages import timestamps
from ingest.recording.log_reader import LogReader
from metrics.replay.replay import replay
from tests.helpers.saying import identity, points, status

NOW_S = 1_790_000_000.0


def log_of_a_crossing(path: Path, *, expected: bool = True, apart_m: float = 0.0) -> Path:
    """Two that cross at 12 s, as a log of lines with `received` and `message`.

    Without `told` both say that they stand; the second passes the crossing `apart_m` behind.
    """
    lines = []

    def say(t_s: float, raw: bytes) -> None:
        lines.append(f'{{"received":"{timestamps.write(t_s)}","message":{raw.decode()}}}\n')

    for name in ("A-1", "B-1"):
        say(NOW_S, identity(name, NOW_S))
    for second in range(25):
        t_s = NOW_S + second
        for name, x, y, yaw in (("A-1", second - 12.0, 0.0, 0.0), ("B-1", 0.0, second - 12.0 - apart_m, pi / 2)):
            dx, dy = (1.0, 0.0) if name == "A-1" else (0.0, 1.0)
            path_points = points(*((t_s + i, x + dx * i, y + dy * i, yaw) for i in range(1, 11)))
            lists = {"path": path_points} if expected else {"operationalState": "idle"}
            say(t_s + 0.05, status(name, t_s, x, y, yaw, **lists))
    path.write_text("".join(lines))
    return path


def scored(log: Path, clearances_m: list[float], site: Site = DEFAULT) -> dict[str, Any]:
    reader = LogReader()
    return replay(reader, reader.read([log]), site, clearances_m)
