"""A run in a process of its own, which is in stretched time like those that it starts."""

import asyncio
import time
from multiprocessing.connection import Connection

from benchmarks.slow_motion.stretched_time import stretch_time


def measure(
    child: Connection, robots: int, engines: int, stretch: float, settle_s: float, seconds: float, a_floor: int,
    calm: bool, tick_s: float, kill: bool,
) -> None:  # fmt: skip
    """Send the figures of a run to `child`. The other arguments are those of `run`."""
    began_s = time.time()
    stretch_time(stretch, began_s)
    from benchmarks.slow_motion.figures import figures  # noqa: PLC0415 - its modules keep references to clocks
    from benchmarks.slow_motion.slow_run import run  # noqa: PLC0415 - the same

    found = run(robots, engines, stretch, began_s, settle_s, seconds, a_floor, calm, tick_s, kill)
    child.send(figures(asyncio.run(found)))
