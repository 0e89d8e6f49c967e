"""The whole service for a long time: `python -m benchmarks.soak [--robots 1000] [--minutes 30] [--json OUT]`.

A row a minute; the last lines say how memory and open files grew from the first row after the start to the last.
"""

import argparse
import json
import time
from dataclasses import asdict
from pathlib import Path

from benchmarks.endtoend import Load, Row, print_row, service

MINUTE_S = 60.0


def soak(robots: int, minutes: int) -> tuple[list[Row], dict[str, float]]:
    """A row for each minute, and what the load says of itself."""
    with service() as one:
        offering = Load(one.url, robots, (minutes + 1) * MINUTE_S)
        time.sleep(MINUTE_S / 4)
        one.row(robots)
        rows = []
        for _ in range(minutes):
            time.sleep(MINUTE_S)
            rows.append(one.row(robots))
            print_row(rows[-1])
        return rows, offering.stop()


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--robots", type=int, default=1000)
    arguments.add_argument("--minutes", type=int, default=30)
    arguments.add_argument("--json", type=Path)
    args = arguments.parse_args()
    rows, offered = soak(args.robots, args.minutes)
    first, last = rows[0], rows[-1]
    print(
        f"memory {sum(first.memory_mb.values()):.0f} -> {sum(last.memory_mb.values()):.0f} MB by role: "
        f"{first.memory_mb} -> {last.memory_mb}"
    )
    print(f"files {sum(first.files.values())} -> {sum(last.files.values())}")
    print(f"load: {offered}")
    if args.json:
        args.json.write_text(json.dumps([asdict(row) for row in rows], indent=2) + "\n")


if __name__ == "__main__":
    main()
