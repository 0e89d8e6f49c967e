"""Memory and import time of the sweep, as one line of JSON: `python -m benchmarks.footprint [ROBOTS]`.

Memory is the peak of the whole process, including libraries, over five seconds of a floor on which all robots report
every second.
"""

import json
import sys
from pathlib import Path
from time import perf_counter

from benchmarks.floors import NOW_S, crowd

AREA_M2, SECONDS = 25.0, 5


def peak_mb() -> float:
    """Linux's own count for this process. `getrusage` would include memory of the parent."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1024


def measured(robots: int) -> dict[str, float]:
    begin, numpy_mb = perf_counter(), peak_mb()
    from deconflict.sweep.incremental import Sweeper  # noqa: PLC0415 - the import is timed

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
