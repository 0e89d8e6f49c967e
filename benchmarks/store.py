"""What storing a revision costs, by how much is stored already: `python -m benchmarks.store [--stored 0 500000]`.

The revisions are those that a pass of the engine publishes on the floor of `benchmarks.stages`. A full store holds the
same ones again and again, of earlier times. Results are microseconds for each revision, to number it and to write it.
"""

import argparse
import tempfile
from collections.abc import Iterator, Sequence
from datetime import timedelta
from pathlib import Path
from time import perf_counter

import numpy as np

from benchmarks.stages import TICK_S, Floor
from deconflict.advisories.words.conflict_wording import new_id
from deconflict.operator.store.store import Store
from deconflict_client.situations import AnyRevision

SETTLING_PASSES = 40


def published(robots: int, seconds: float) -> list[Sequence[AnyRevision]]:
    """What each pass publishes on a floor."""
    passes = list[Sequence[AnyRevision]]()
    floor = Floor(robots, publish=passes.append)
    floor.run(np.arange(0.0, seconds, TICK_S))
    return passes


def earlier(passes: Sequence[Sequence[AnyRevision]], seconds: float) -> Iterator[Sequence[AnyRevision]]:
    """The passes again, as many seconds earlier; their advisories have other ids."""
    by, ids = timedelta(seconds=seconds), dict[str, str]()
    for revisions in passes:
        again = list[AnyRevision]()
        for revision in revisions:
            raised_s = revision.raised_at.timestamp() - seconds
            new = ids.setdefault(revision.id, new_id(f"{revision.id} {seconds}", raised_s))
            times = {name: getattr(revision, name) - by for name in ("raised_at", "updated_at", "predicted_at")}
            again.append(revision.model_copy(update={"id": new, **times}))
        yield again


def fill(store: Store, passes: Sequence[Sequence[AnyRevision]], revisions: int) -> None:
    """Store as many revisions, of times before the floor's."""
    length_s = len(passes) * TICK_S
    rounds = -(-revisions // sum(map(len, passes)))
    for number in range(rounds, 0, -1):
        for pass_revisions in earlier(passes, number * length_s):
            store.accept(pass_revisions)
        store.flush()


def measured(store: Store, passes: Sequence[Sequence[AnyRevision]]) -> tuple[float, float, float]:
    """Microseconds to number a revision and to write it, and the milliseconds that the slowest pass took to write."""
    number_s = write_s = slowest_s = 0.0
    revisions = 0
    for index, pass_revisions in enumerate(passes):
        began_s = perf_counter()
        store.accept(pass_revisions)
        accepted_s = perf_counter()
        store.flush()
        ended_s = perf_counter()
        if index >= SETTLING_PASSES:
            number_s += accepted_s - began_s
            write_s += ended_s - accepted_s
            slowest_s = max(slowest_s, ended_s - accepted_s)
            revisions += len(pass_revisions)
    return number_s / revisions * 1e6, write_s / revisions * 1e6, slowest_s * 1e3


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--robots", type=int, default=10_000)
    arguments.add_argument("--seconds", type=float, default=12.0)
    arguments.add_argument("--stored", type=int, nargs="+", default=[0, 500_000], help="revisions in the store before")
    args = arguments.parse_args()
    passes = published(args.robots, args.seconds)
    for stored in args.stored:
        with tempfile.TemporaryDirectory(prefix="benchmark-") as directory:
            store = Store(Path(directory))
            fill(store, passes, stored)
            number_us, write_us, slowest_ms = measured(store, passes)
            size_mb = store.used_bytes() / 1e6
            store.close()
        print(
            f"{stored:8} revisions stored before, {size_mb:5.0f} MB: us per revision: number {number_us:.0f}, "
            f"write {write_us:.0f}; slowest pass {slowest_ms:.0f} ms",
            flush=True,
        )


if __name__ == "__main__":
    main()
