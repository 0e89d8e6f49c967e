"""Compiles kernels on all cores. A process that imports them afterwards finds them on disk."""

import gc
import logging
import os
import re
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from importlib.util import find_spec
from pathlib import Path

from deconflict.runtime.command_parsers import GC_THRESHOLDS
from deconflict.runtime.worker_process import SPAWN, prepare_worker

ALL_PACKAGES = ("deconflict", "ingest", "metrics")
"""Those with kernels. A replay needs them all."""
MOST_PROCESSES = 8
"""Each needs 250 MB."""
_KERNEL = re.compile(r"^@kernel\(", re.MULTILINE)

log = logging.getLogger(__name__)

Report = Callable[[int, int], object]
"""Is called with the number of kernels that are done, and of all."""


def compile_kernels(packages: Iterable[str], report: Report) -> None:
    """Compile every kernel of some packages that is not on disk, at low priority. The largest files come first."""
    counts = {name: count for package in packages for name, count in _kernels_of(package)}
    done, total = 0, sum(counts.values())
    report(done, total)
    processes = min(len(os.sched_getaffinity(0)), MOST_PROCESSES, len(counts))
    try:
        with ProcessPoolExecutor(processes, SPAWN, _prepare_worker) as pool:
            compiling = {pool.submit(_compile_module, name): count for name, count in counts.items()}
            for future in as_completed(compiling):
                future.result()
                done += compiling[future]
                report(done, total)
    except BrokenProcessPool:
        log.warning("a process that compiles kernels was killed, perhaps for lack of memory; one process goes on")


def report_on_terminal(done: int, total: int) -> None:
    """A `Report` for people: one line that changes on a terminal; in a file a line at the beginning and at the end."""
    line = f"compiling kernels, once on this machine: {done} of {total}"
    if sys.stderr.isatty():
        sys.stderr.write(f"\r{line}" + "\n" * (done == total))
    elif done in (0, total):
        sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def _kernels_of(package: str) -> list[tuple[str, int]]:
    """The modules of a package that have kernels, and how many; the largest first."""
    spec = find_spec(package)
    found = []
    for folder in map(Path, (spec and spec.submodule_search_locations) or ()):
        for path in folder.rglob("*.py"):
            source = path.read_text()
            if count := len(_KERNEL.findall(source)):
                name = ".".join((package, *path.relative_to(folder).with_suffix("").parts))
                found.append((len(source), name, count))
    return [(name, count) for _, name, count in sorted(found, reverse=True)]


def _prepare_worker() -> None:
    """Begin a process that compiles. Python's garbage collector runs less often in it: it scanned again and again what
    numba keeps of each function, for an eighth of the time."""
    prepare_worker()
    gc.set_threshold(*GC_THRESHOLDS)


def _compile_module(name: str) -> None:
    from ingest.kernels import compile_module  # noqa: PLC0415 - loads numba

    compile_module(name)
