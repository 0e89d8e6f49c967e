"""The options of a question on the command line."""

import argparse
import os
from pathlib import Path

from deconflict.runtime.command_parsers import MOST_JOBS, Commands, add_command, whole_in

SEEDS, MOST_SEEDS = 6, 1000


def add_whatif(commands: Commands) -> argparse.ArgumentParser:
    """Add the command, without its logs."""
    command = add_command(
        commands,
        "whatif",
        "say what a change of the floor would change, by driving a log's trips again in a simulation",
        "deconflict whatif data/log --site SITE.toml --one-way aisle-4",
        "deconflict whatif data/log --site SITE.toml --suggest",
        "deconflict whatif data/log --site SITE.toml --speed dock-aisle 0.8 --json answer.json",
    )
    _add_changes(command.add_mutually_exclusive_group(required=True))
    command.add_argument("--reverse", action="store_true", help="with --one-way: the other direction")
    command.add_argument(
        "--seeds",
        type=whole_in(1, MOST_SEEDS),
        default=SEEDS,
        metavar="N",
        help=f"runs with and without it (default: {SEEDS})",
    )
    command.add_argument(
        "--jobs",
        type=whole_in(1, MOST_JOBS),
        default=os.cpu_count() or 1,
        metavar="N",
        help="runs at once (default: one a core)",
    )
    command.add_argument("--json", type=Path, metavar="OUT.json", help="also write the answer to this file")
    return command


def _add_changes(change: argparse._MutuallyExclusiveGroup) -> None:
    change.add_argument("--one-way", metavar="AISLE", help="make an aisle or area one-way, as most robots drive there")
    change.add_argument(
        "--speed", nargs=2, metavar=("PLACE", "SHARE"), help="limit the speed in a place to a share of the robot's own"
    )
    change.add_argument(
        "--dock", metavar="PLACE", help="add one more dock, charger or station beside one that the site file names"
    )
    change.add_argument(
        "--widen",
        nargs="+",
        metavar=("AISLE", "METRES"),
        help="make an aisle wider; without METRES, as much as robots need to pass each other",
    )
    change.add_argument("--order", metavar="PLACE", help="let robots into a crossing or lane from one side at a time")
    change.add_argument("--priority", metavar="VENDOR", help="let the robots of a vendor go first")
    change.add_argument(
        "--suggest", action="store_true", help="find from the losses of the log what to change, and simulate it"
    )
    change.add_argument("--follow-advice", action="store_true", help="let robots do what situations ask for, at once")
    change.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        dest="other_settings",
        help="other settings of the service: what it would have warned of",
    )
