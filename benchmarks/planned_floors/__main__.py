"""The command line: make floors, score what was told on them, compare services on many."""

import argparse
import json
from pathlib import Path

from benchmarks.planned_floors.figures import figures
from benchmarks.planned_floors.scoring import score
from benchmarks.planned_floors.tables import table

CLEARANCE_M = 0.3


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    commands = options.add_subparsers(required=True)
    _add_score(commands)
    args = options.parse_args()
    args.run(args)


def _add_score(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    command = commands.add_parser("score", help="advisories and the believer of paths against the truth of one log")
    command.add_argument("log", type=Path, metavar="LOG")
    command.add_argument("truth", type=Path, metavar="TRUTH", help="a directory that `make` wrote, or a list of stops")
    command.add_argument("advisories", type=Path, nargs="*", metavar="ADVISORIES", help="of `replay --advisories`")
    command.add_argument("--clearance", type=float, default=CLEARANCE_M, metavar="M")
    command.add_argument("--json", type=Path, metavar="OUT.json")
    command.set_defaults(run=_score)


def _score(args: argparse.Namespace) -> None:
    found = score(args.log, args.truth, args.advisories, args.clearance)
    by_service = {name: figures(cases) for name, cases in found.items()}
    print(table(by_service))
    if args.json:
        args.json.write_text(json.dumps(by_service, indent=2) + "\n")


if __name__ == "__main__":
    main()
