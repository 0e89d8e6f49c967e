"""The command line: halls with and without advice, side by side."""

import argparse
from collections.abc import Sequence

from benchmarks.closed_loop.halls.ground.floors import KINDS
from benchmarks.closed_loop.halls.motion.vendors import HABITS, VENDORS, Compliance
from benchmarks.closed_loop.halls.runs import ADVISERS, ALONE, NONE, ONE_PLAN, Run, side_by_side, table


def main(arguments: Sequence[str] | None = None) -> None:
    options = argparse.ArgumentParser(prog="python -m benchmarks.closed_loop.halls", description=__doc__)
    options.add_argument("--floor", choices=KINDS, nargs="+", default=list(KINDS))
    options.add_argument("--habit", choices=HABITS, nargs="+", default=["wait_15s"])
    options.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    options.add_argument("--adviser", choices=ADVISERS, nargs="+", default=list(ADVISERS), help="`none` is always run")
    options.add_argument("--references", action="store_true", help="also each vendor alone, and all robots as one plan")
    options.add_argument("--obey", type=float, default=1.0, help="share of the robots that follow requests")
    options.add_argument("--delay", type=float, nargs=2, default=(0.3, 0.3), metavar="S", help="least and greatest")
    options.add_argument("--unwilling", choices=VENDORS, default="", help="a vendor that never follows")
    options.add_argument("--declines", action="store_true", help="who does not follow says so")
    options.add_argument("--minutes", type=float, default=7.0, help="scored from minute 3 on")
    options.add_argument("--jobs", type=int, default=1, choices=(1, 2))
    args = options.parse_args(arguments)
    compliance = Compliance(args.obey, tuple(args.delay), args.unwilling, args.declines)
    advisers = list(dict.fromkeys([NONE, *args.adviser, *((ALONE, ONE_PLAN) if args.references else ())]))
    for floor in args.floor:
        for habit in args.habit:
            runs = [Run(floor, habit, s, a, compliance, args.minutes) for a in advisers for s in args.seeds]
            print(
                f"\n{floor}, {habit}, seeds {args.seeds}, obey {args.obey:g}\n{table(side_by_side(runs, args.jobs))}",
                flush=True,
            )


if __name__ == "__main__":
    main()
