"""The command line: make floors, score advisories on them, compare services on many."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.planned_floors.comparison.compare import Plan, compared, log_cases, make, site_with
from benchmarks.planned_floors.comparison.found_interactions import finder_figures
from benchmarks.planned_floors.comparison.service_parts import PARTS
from benchmarks.planned_floors.comparison.tells import KeptFloor, baseline, document, table_of_tells, told
from benchmarks.planned_floors.comparison.tells import Plan as TellsPlan
from benchmarks.planned_floors.comparison.tells_limits import verdict
from benchmarks.planned_floors.floors.kinds import KINDS, made_of
from benchmarks.planned_floors.logs.reduced_log import TELLS
from benchmarks.planned_floors.scoring.all_figures import figures
from benchmarks.planned_floors.scoring.figure import Figure
from benchmarks.planned_floors.scoring.markdown import table
from benchmarks.planned_floors.scoring.scored_floor import score

CLEARANCE_M = 0.3
REPORT_EVERY = "seconds between a robot's reports; the kind's own if not given"


def main(arguments: Sequence[str] | None = None) -> None:
    options = argparse.ArgumentParser(prog="python -m benchmarks.planned_floors", description=__doc__)
    commands = options.add_subparsers(required=True)
    _add_make(commands.add_parser("make", help="simulate a floor: its log and its truth"))
    _add_score(commands.add_parser("score", help="advisories and the believer of paths against the truth of one log"))
    _add_replay(commands.add_parser("replay", help="one log through the service, scored the same way"))
    _add_finder(commands.add_parser("finder", help="who gave way to whom, as the service finds it, against the truth"))
    _add_compare(commands.add_parser("compare", help="floors of several kinds and seeds through the service"))
    _add_tells(commands.add_parser("tells", help="the same floors with robots that report more or less"))
    args = options.parse_args(arguments)
    args.run(args)


def _add_make(command: argparse.ArgumentParser) -> None:
    command.add_argument("--kind", choices=KINDS, required=True)
    command.add_argument("--seed", type=int, default=1)
    _add_seconds(command)
    command.add_argument("--report-every", type=float, metavar="S", help=REPORT_EVERY)
    command.add_argument("--out", type=Path, required=True, metavar="DIR")
    command.set_defaults(run=_make)


def _add_score(command: argparse.ArgumentParser) -> None:
    _add_log(command)
    command.add_argument("advisories", type=Path, nargs="*", metavar="ADVISORIES", help="of `replay --advisories`")
    _add_scoring(command)
    command.set_defaults(run=_score)


def _add_replay(command: argparse.ArgumentParser) -> None:
    _add_log(command)
    _add_scoring(command)
    _add_parts(command)
    command.set_defaults(run=_replay)


def _add_finder(command: argparse.ArgumentParser) -> None:
    _add_log(command)
    _add_clearance_and_json(command)
    command.set_defaults(run=_finder)


def _add_compare(command: argparse.ArgumentParser) -> None:
    command.add_argument("--kinds", nargs="+", choices=KINDS, required=True, metavar="KIND")
    _add_floors(command)
    command.add_argument(
        "--report-every", nargs="+", type=float, default=[None], metavar="S", help=f"{REPORT_EVERY}; each for itself"
    )
    command.add_argument("--jobs", type=int, default=1, choices=(1, 2), help="worker processes, a floor each")
    command.add_argument("--tables", type=Path, metavar="DIR", help="one table of each kind, as KIND.md and KIND.json")
    _add_scoring(command)
    _add_parts(command)
    command.set_defaults(run=_compare)


def _add_tells(command: argparse.ArgumentParser) -> None:
    command.add_argument("--kinds", nargs="*", choices=KINDS, default=[], metavar="KIND")
    _add_floors(command)
    command.add_argument(
        "--log",
        nargs=2,
        type=Path,
        action="append",
        default=[],
        metavar=("LOG", "TRUTH"),
        help="a floor that is there already, beside the kinds; repeat it for several",
    )
    command.add_argument("--tells", nargs="+", choices=TELLS, default=list(TELLS), metavar="NAME", help=" ".join(TELLS))
    command.add_argument("--baseline", type=Path, metavar="FILE.json", help="what --json wrote under another release")
    _add_scoring(command)
    command.set_defaults(run=_tells)


def _add_floors(command: argparse.ArgumentParser) -> None:
    command.add_argument("--seeds", nargs="+", type=int, default=[1], metavar="N")
    _add_seconds(command)
    command.add_argument("--floors", type=Path, required=True, metavar="DIR", help="where the floors are kept")


def _add_log(command: argparse.ArgumentParser) -> None:
    command.add_argument("log", type=Path, metavar="LOG")
    command.add_argument("truth", type=Path, metavar="TRUTH", help="a directory that `make` wrote, or a list of stops")


def _add_seconds(command: argparse.ArgumentParser) -> None:
    command.add_argument("--seconds", type=float, metavar="S", help="length of the log; the kind's own if not given")


def _add_clearance_and_json(command: argparse.ArgumentParser) -> None:
    command.add_argument("--clearance", type=float, default=CLEARANCE_M, metavar="M")
    command.add_argument("--json", type=Path, metavar="OUT.json")


def _add_scoring(command: argparse.ArgumentParser) -> None:
    _add_clearance_and_json(command)
    command.add_argument(
        "--after", type=float, default=0.0, metavar="S", help="score only what happens later than this"
    )


def _add_parts(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--without", nargs="*", choices=PARTS, default=[], metavar="PART", help="switched off, each alone"
    )


def _make(args: argparse.Namespace) -> None:
    make(made_of(args.kind, args.seed, args.seconds, args.report_every), args.out)


def _score(args: argparse.Namespace) -> None:
    found = score(args.log, args.truth, args.advisories, args.clearance, args.after)
    _show(args, {name: figures(cases) for name, cases in found.items()})


def _replay(args: argparse.Namespace) -> None:
    found = log_cases(args.log, args.truth, args.clearance, args.after, args.without)
    _show(args, {name: figures(cases) for name, cases in found.items()})


def _finder(args: argparse.Namespace) -> None:
    _show(args, {"finder": finder_figures(args.log, args.truth, site_with(args.clearance))})


def _compare(args: argparse.Namespace) -> None:
    plan = Plan(
        kinds=args.kinds,
        seeds=args.seeds,
        floors=args.floors,
        clearance_m=args.clearance,
        seconds=args.seconds,
        report_every_s=args.report_every,
        after_s=args.after,
        parts=args.without,
    )
    documents = []
    for comparison in compared(plan, args.jobs):
        print(f"\n{comparison.markdown()}", flush=True)
        if args.tables:
            comparison.save(args.tables)
        documents.append(comparison.document())
        _write(args, documents)


def _tells(args: argparse.Namespace) -> None:
    plan = TellsPlan(
        kinds=args.kinds,
        seeds=args.seeds,
        kept=[KeptFloor(log, truth) for log, truth in args.log],
        tells=args.tells,
        floors=args.floors,
        clearance_m=args.clearance,
        seconds=args.seconds,
        after_s=args.after,
    )
    before, by_kind = baseline(args.baseline) if args.baseline else {}, {}
    for kind, by_tells in told(plan):
        by_kind[kind] = by_tells
        print(f"\n{kind}\n\n{table_of_tells(by_tells, before.get(kind))}\n", flush=True)
        print(verdict(by_tells, before.get(kind)), flush=True)
        _write(args, document(by_kind, plan))


def _show(args: argparse.Namespace, by_service: dict[str, dict[str, Figure]]) -> None:
    print(table(by_service))
    _write(args, by_service)


def _write(args: argparse.Namespace, found: Any) -> None:
    if args.json:
        args.json.write_text(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
