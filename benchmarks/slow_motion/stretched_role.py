"""One process in stretched time: a role of the service, or a load of robots that reports to one.

`python -m benchmarks.slow_motion.stretched_role STRETCH BEGAN_S ROLE RUNTIME DATA`, or with `load URL ROBOTS FLOOR
CALM` for the last three. A load ends when its standard input is closed, and prints its figures.
"""

import asyncio
import json
import sys
import threading
from dataclasses import asdict
from math import inf
from pathlib import Path

from benchmarks.slow_motion.stretched_time import stretch_time


def main() -> int:
    stretch, began_s = map(float, sys.argv[1:3])
    del sys.argv[1:3]
    stretch_time(stretch, began_s)
    if sys.argv[1] == "load":
        url, *numbers = sys.argv[2:]
        _load(url, *map(int, numbers))
        return 0
    from deconflict.roles.__main__ import begin, run  # noqa: PLC0415 - its modules keep references to clocks

    role, runtime, data = sys.argv[1:]
    begin()
    return run(role, Path(runtime), Path(data))


def _load(url: str, robots: int, floor: int, calm: int) -> None:
    from benchmarks.offer import Circling, offer  # noqa: PLC0415 - the same

    ended = threading.Event()

    def wait_for_end() -> None:
        sys.stdin.read()
        ended.set()

    threading.Thread(target=wait_for_end, daemon=True).start()
    offered = asyncio.run(offer(url, Circling(robots, floor=floor, calm=bool(calm)), inf, ended.is_set))
    print(json.dumps(asdict(offered)), flush=True)


if __name__ == "__main__":
    sys.exit(main())
