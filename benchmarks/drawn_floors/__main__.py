"""Draws floors and drives each with and without its other robots: `python -m benchmarks.drawn_floors [--floors 200]`.

Every floor has `--robots` robots, a fifth to a half of them honest, at one per 25 m2, crossing each other's way. The
others are of one to three kinds (`benchmarks/drawn_floors/others.py`): large bodies, heaps, crowds that fall silent,
very fast, converging, jumping and more, of one or many makers and addresses. The fleet and the engine of the service
get the messages of each floor in simulated time, once of the honest robots alone and once of all.

The figures of a pass are the greatest median of 20 passes in a row, compared with the median pass of as many honest
robots at one per 25 m2 in the same run. Pairs are pairs of robots. Beside them stand the pairs of boxes of one second,
of which two robots beside each other have ten. The warnings of honest pairs beside others are compared with those
without, but for robots that meet one of the others. A drive is given up if a pass takes more than 5 s of processor
time. All drives begin with what was learned of other honest robots before, as in a service that has run for a while:
what an engine learns first, it learns from whoever is there.
"""

import argparse
import gc
import json
from pathlib import Path
from typing import Any

from benchmarks.drawn_floors.figures import line, table
from benchmarks.drawn_floors.floor import drawn_floor, honest_floor
from benchmarks.drawn_floors.measuring import Terms, measured, reference
from benchmarks.drawn_floors.others import KINDS
from deconflict.runtime.command_parsers import GC_THRESHOLDS

REFERENCE_EVERY = 10
LEARNING_S = 80.0
"""For how long honest robots are heard before."""


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--floors", type=int, default=200)
    arguments.add_argument("--first", type=int, default=0, help="number of the first floor")
    arguments.add_argument("--robots", type=int, default=300)
    arguments.add_argument("--seed", type=int, default=0)
    arguments.add_argument("--seconds", type=float, default=40.0, help="simulated seconds")
    arguments.add_argument("--passes", type=int, default=5, help="passes a simulated second")
    arguments.add_argument("--kinds", nargs="+", choices=list(KINDS), help="all floors have these others")
    arguments.add_argument("--unlearned", action="store_true", help="begin without what was learned of honest robots")
    arguments.add_argument("--json", type=Path)
    args = arguments.parse_args()
    gc.set_threshold(*GC_THRESHOLDS)
    terms, usual, results = Terms(LEARNING_S, args.passes), dict[str, float](), list[dict[str, Any]]()
    learned = {} if args.unlearned else terms.drive(honest_floor(args.robots, LEARNING_S, args.seed)).learned
    terms = Terms(args.seconds, args.passes, learned)
    for number in range(args.first, args.first + args.floors):
        if number % REFERENCE_EVERY == 0 or not usual:
            usual = reference(args.robots, args.seed + number, terms)
        floor = drawn_floor(number, args.robots, args.seconds, args.seed, tuple(args.kinds or ()))
        results.append(measured(floor, terms, usual))
        print(line(results[-1]), flush=True)
        if args.json:
            args.json.write_text(json.dumps(results, indent=1) + "\n")
    print("\n".join(["", *table(results)]))


if __name__ == "__main__":
    main()
