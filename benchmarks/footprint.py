"""What the sweep takes besides time: `python -m benchmarks.footprint [ROBOTS]`, as one line of JSON.

Memory is the peak of the whole process, libraries included, over five seconds of a floor that is told anew each second.
"""

import json
import sys
from pathlib import Path
from time import perf_counter

from benchmarks.floors import NOW_S, crowd

AREA_M2, SECONDS = 25.0, 5


def peak_mb() -> float:
    """By Linux's own count of this process; `getrusage` counts what a parent held as well."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1024


def measured(robots: int) -> dict[str, float]:
    begin, numpy_mb = perf_counter(), peak_mb()
    from deconflict.sweep.incremental import Sweeper  # noqa: PLC0415 - its import is what is timed

    import_s, idle_mb = perf_counter() - begin, peak_mb()
    if robots:
        world, keys = crowd(robots, AREA_M2), [f"robot-{row:05d}" for row in range(robots)]
        sweeper = Sweeper(clearance_m=0.3)
        for second in range(SECONDS):
            sweeper.update(keys, world.forecasts(float(second)))
            sweeper.find_conflicts(NOW_S + second)
    return {"import_s": import_s, "numpy_mb": numpy_mb, "idle_mb": idle_mb, "peak_mb": peak_mb()}


if __name__ == "__main__":
    print(json.dumps(measured(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000)))
