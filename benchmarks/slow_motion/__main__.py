"""A whole cluster on this machine in slow motion: `python -m benchmarks.slow_motion --robots 5000 --stretch 4`.

A real NATS server, real ingests with sockets, engines and an operator face run, each in processes of its own, in time
that is stretched: a simulated second lasts `--stretch` seconds. So a few cores show what many robots cost, and what
saturates first. One floor of about `--floor` robots has one ingest; a robot has 69 m2, or 46
with `--busy`, and reports once a second with ten points of path. With `--kill` an engine is killed after the measured
seconds. The stretch is large enough if the load is not late and every engine makes its passes, one each
`--tick` seconds. The time from an engine's decision to a subscriber of the face is measured there.

This needs nats-server.
"""

import argparse
import multiprocessing

from benchmarks.slow_motion.started_cluster import SERVER
from benchmarks.slow_motion.stretched_run import measure

ROBOTS_A_STRETCH, ROBOTS_AN_ENGINE = 1_250, 12_500
LOADED_TICK_S = 0.1
"""The time between two ticks of a loaded ingest."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, nargs="+", default=[5000])
    parser.add_argument("--engines", type=int, help=f"one for {ROBOTS_AN_ENGINE:,} robots if not given, at least two")
    parser.add_argument("--stretch", type=float, help=f"one for {ROBOTS_A_STRETCH:,} robots if not given")
    parser.add_argument("--seconds", type=float, default=10.0, help="simulated seconds that are measured")
    parser.add_argument(
        "--settle", type=float, default=5.0, help="simulated seconds from the first statuses until then"
    )
    parser.add_argument("--floor", type=int, default=10_000, help="robots of a floor, at most 20,000")
    parser.add_argument("--busy", action="store_true", help="ten times as many robots meet, as in the other benchmarks")
    parser.add_argument("--tick", type=float, default=LOADED_TICK_S, help="`engine.tick_s` of all processes")
    parser.add_argument("--kill", action="store_true", help="kill an engine in the end")
    args = parser.parse_args()
    if SERVER is None:
        print("this needs nats-server, which Debian has as a package")
        return 1
    columns = [_column(robots, args) for robots in args.robots]
    print("| " + " | ".join(["", *(column["robots"] for column in columns)]) + " |")
    print("| " + " | ".join(["---"] * (1 + len(columns))) + " |")
    for name in columns[0]:
        print(f"| {name} | " + " | ".join(column.get(name, "") for column in columns) + " |")
    return 0


def _column(robots: int, args: argparse.Namespace) -> dict[str, str]:
    """The figures of one run."""
    engines = args.engines or max(round(robots / ROBOTS_AN_ENGINE), 2)
    stretch = args.stretch or max(robots / ROBOTS_A_STRETCH, 1.0)
    spawn = multiprocessing.get_context("spawn")
    parent, child = spawn.Pipe()
    arguments = (
        child,
        robots,
        engines,
        stretch,
        args.settle,
        args.seconds,
        args.floor,
        not args.busy,
        args.tick,
        args.kill,
    )
    process = spawn.Process(target=measure, args=arguments)
    process.start()
    child.close()
    column: dict[str, str] = parent.recv()
    process.join()
    for name, text in column.items():
        print(f"{name}: {text}", flush=True)
    print()
    return column


if __name__ == "__main__":
    raise SystemExit(main())
