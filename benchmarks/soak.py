"""The whole service for a long time: `python -m benchmarks.soak [--robots 1000] [--minutes 30] [--table OUT.md]`.

Prints two tables in Markdown: the figures by minute, and the growth of memory and open files of each role. Growth is
the slope of a line through the second half of the run, when all caches are full, with its standard error.
"""

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.endtoend import LATE_S, Load, Row, print_row, service

MINUTE_S = 60.0
CERTAIN = 2.0
"""A slope differs from 0 if it is larger than this many of its standard errors."""

HEAD = (
    *("minutes", "messages/s", "p50, ms", "p99, ms", "slowest below, ms", f"over {LATE_S:g} s", "superseded", "shed"),
    *("missed deadlines", "revisions", "cores", "memory, MB", "files"),
)


def soak(robots: int, minutes: int) -> tuple[list[Row], dict[str, float]]:
    """A row for each minute, and the figures of the load."""
    with service() as running:
        load = Load(running.url, robots, (minutes + 1) * MINUTE_S)
        time.sleep(MINUTE_S / 4)
        running.row(robots)
        rows = []
        for _ in range(minutes):
            time.sleep(MINUTE_S)
            rows.append(running.row(robots))
            print_row(rows[-1])
        return rows, load.stop()


def table(rows: Sequence[Row], load: dict[str, float]) -> str:
    """The run in Markdown."""
    accepted, rejected, shed = (sum(getattr(row, name) for row in rows) for name in ("accepted", "rejected", "shed"))
    run = (
        f"{rows[0].robots} robots, {len(rows)} minutes: {accepted:.0f} messages accepted, {rejected:.0f} rejected, "
        f"{shed:.0f} shed, {load['broken']:.0f} connections broken. "
        f"The load itself was at most {load['late_s'] * 1000:.0f} ms late."
    )
    lines = [
        run,
        "",
        f"| {' | '.join(HEAD)} |",
        f"|{' --- |' * len(HEAD)}",
        *map(_line, _parts(rows)),
        "",
        "| role | memory, MB, first and last | MB per hour | files, first and last | files per hour |",
        f"|{' --- |' * 5}",
        *_growth(rows),
    ]
    return "\n".join(lines) + "\n"


def _parts(rows: Sequence[Row], most: int = 10) -> Iterator[tuple[int, Sequence[Row]]]:
    """The run in at most `most` equal parts: the first minute of each, and its rows."""
    length = -(-len(rows) // most)
    for first in range(0, len(rows), length):
        yield first + 1, rows[first : first + length]


def _line(stretch: tuple[int, Sequence[Row]]) -> str:
    first, rows = stretch
    last, seconds = rows[-1], sum(row.seconds for row in rows)
    minutes = f"{first}" if len(rows) == 1 else f"{first}-{first + len(rows) - 1}"
    cores = sum(sum(row.core_s_a_second.values()) * row.seconds for row in rows) / seconds
    values = (
        minutes,
        f"{sum(row.accepted for row in rows) / seconds:.0f}",
        f"{np.median([row.p50_ms for row in rows]):.0f}",
        f"{max(row.p99_ms for row in rows):.0f}",
        f"{max(row.slowest_ms for row in rows):.0f}",
        *(
            f"{sum(getattr(row, name) for row in rows):.0f}"
            for name in ("late", "superseded", "shed", "missed", "advisories")
        ),
        f"{cores:.2f}",
        f"{sum(last.memory_mb.values()):.0f}",
        f"{sum(last.files.values())}",
    )
    return f"| {' | '.join(values)} |"


def _growth(rows: Sequence[Row]) -> Iterator[str]:
    half = rows[len(rows) // 2 :]
    for role in rows[0].memory_mb:
        memory = [row.memory_mb[role] for row in half if role in row.memory_mb]
        files = [float(row.files[role]) for row in half if role in row.files]
        yield (
            f"| {role} | {rows[0].memory_mb[role]:.0f}, {rows[-1].memory_mb[role]:.0f} | {_growth_text(memory)} "
            f"| {rows[0].files[role]}, {rows[-1].files[role]} | {_growth_text(files)} |"
        )


def slope(values: Sequence[float]) -> tuple[float, float]:
    """The slope per hour of a line through values that are a minute apart, and its standard error."""
    minutes = np.arange(len(values)) - (len(values) - 1) / 2
    spread = float((minutes**2).sum())
    rise = float((minutes * values).sum()) / spread
    left = np.asarray(values) - np.mean(values) - rise * minutes
    error = float(np.sqrt((left**2).sum() / max(len(values) - 2, 1) / spread))
    return rise * MINUTE_S, error * MINUTE_S


def _growth_text(values: Sequence[float]) -> str:
    if len(values) < 3:
        return "too short"
    rise, error = slope(values)
    return f"{rise:+.1f} ± {error:.1f}{'' if abs(rise) > CERTAIN * error else ', flat'}"


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--robots", type=int, default=1000)
    arguments.add_argument("--minutes", type=int, default=30)
    arguments.add_argument("--json", type=Path)
    arguments.add_argument("--table", type=Path, help="write the tables here too")
    args = arguments.parse_args()
    rows, offered = soak(args.robots, args.minutes)
    text = table(rows, offered)
    print(text)
    if args.table:
        args.table.write_text(text)
    if args.json:
        document: dict[str, Any] = {"rows": [asdict(row) for row in rows], "load": offered}
        args.json.write_text(json.dumps(document, indent=2) + "\n")


if __name__ == "__main__":
    main()
