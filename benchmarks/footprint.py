"""Memory and import time of the sweep, as one line of JSON: `python -m benchmarks.footprint [ROBOTS]`.

Memory is the peak of the whole process, including libraries, over five seconds of a floor on which all robots report
every second.

`python -m benchmarks.footprint service` gives the memory of the service without a robot: of each process, and of all
with what they share counted once, whatever else on the machine maps the same libraries.
"""

import json
import os
import re
import sys
import time
from collections import Counter
from pathlib import Path
from time import perf_counter

from benchmarks.floors import NOW_S, crowd

AREA_M2, SECONDS = 25.0, 5
SETTLED_S = 20.0
PRIVATE = ""
MAPPING = re.compile(r"^[0-9a-f]+-[0-9a-f]+ \S+ \S+ \S+ \S+\s*(.*)$")
"""The first line of a mapping in `smaps`; the group is its file."""


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


def service_mb() -> dict[str, float]:
    """Resident memory of each process of the service, and of all with what they share counted once."""
    from benchmarks.endtoend import service  # noqa: PLC0415 - the other measurement is of a process without it

    with service() as running:
        running.documents()
        time.sleep(SETTLED_S)
        processes = (*running.roles, running.fork_server)
        pids = {process.role: process.pid for process in processes if process.pid} | {"supervisor": os.getpid()}
        maps = {name: mapped_kb(pid) for name, pid in pids.items()}
        private = sum(private_kb(pid) for pid in pids.values())
    files: Counter[str] = Counter()
    for own in maps.values():
        for file, kb in own.items():
            files[file] = max(files[file], kb)
    shared = sum(kb for file, kb in files.items() if file != PRIVATE)
    rows = {name: sum(own.values()) / 1024 for name, own in maps.items()}
    return {name: round(mb) for name, mb in (rows | {"all_once": (private + shared) / 1024}).items()}


def private_kb(pid: int) -> int:
    """Memory that belongs to no file. What forks share is divided among them."""
    rollup = (Path("/proc") / str(pid) / "smaps_rollup").read_text()
    return int(rollup.split("Pss_Anon:")[1].split()[0])


def mapped_kb(pid: int) -> Counter[str]:
    """Resident memory by mapped file; what belongs to no file counts as `PRIVATE`."""
    kb: Counter[str] = Counter()
    file = PRIVATE
    for line in (Path("/proc") / str(pid) / "smaps").read_text().splitlines():
        if mapping := MAPPING.match(line):
            file = mapping[1] if mapping[1].startswith("/") else PRIVATE
        elif line.startswith("Rss:"):
            kb[file] += int(line.split()[1])
        elif line.startswith("Anonymous:") and file != PRIVATE:
            kb[PRIVATE] += int(line.split()[1])
            kb[file] -= int(line.split()[1])
    return kb


def main() -> None:
    arguments = sys.argv[1:]
    if arguments == ["service"]:
        print(json.dumps(service_mb()))
    else:
        print(json.dumps(measured(int(arguments[0]) if arguments else 10_000)))


if __name__ == "__main__":
    main()
