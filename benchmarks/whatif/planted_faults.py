"""In how many floors a planted fault is found: `python -m benchmarks.whatif.planted_faults`.

Ten floors with one fault each. What counts is whether its place is among the five worst, whether its cause is named,
and whether a change that repairs it is suggested there. With `--faultless` the floors have no fault, and what counts is
on how many of them a change is said to pay.
"""

import argparse
from collections.abc import Sequence
from typing import NamedTuple

from benchmarks.whatif.planted_floor import PlantedFloor, planted_floor
from metrics.whatif.suggested_changes import suggested

KNOWN = {
    "lane too narrow": ("narrow_lane", ("one_way", "widen", "order")),
    "second charger missing": ("few_resources", ("dock",)),
    "one-way the wrong way": ("opposed_one_way", ("one_way",)),
    "crossing without order": ("unordered_crossing", ("order",)),
}
"""The cause and the repairs of each fault."""


class Found(NamedTuple):
    """What was found of a planted fault."""

    place: bool
    cause: bool
    repair: bool


def found(floor: PlantedFloor, seed: int, args: argparse.Namespace) -> Found:
    changes = suggested(floor.recorded(seed, 60 * args.minutes), floor.site, (), args)
    print(*(f"  {line}" for line in changes.lines()), sep="\n", flush=True)
    cause, repairs = KNOWN[floor.fault]
    at = next((place for place in changes.places if place.place == floor.place), None)
    if at is None:
        return Found(place=False, cause=False, repair=False)
    repair = next((change for change in at.tried if change == at.best), None)
    return Found(place=True, cause=at.cause == cause, repair=repair is not None and repair.kind in repairs)


def _print_false(args: argparse.Namespace) -> None:
    """On how many floors without a fault a change that was tried is said to pay."""
    false = tried = 0
    for number in args.floors:
        floor = planted_floor(number, is_planted=False)
        changes = suggested(floor.recorded(args.seed + number, 60 * args.minutes), floor.site, (), args)
        print(f"Floor {number}", *(f"  {line}" for line in changes.lines()), sep="\n", flush=True)
        answered = [change for place in changes.places for change in place.tried if change.saving]
        tried, false = tried + len(answered), false + any(change.pays for change in answered)
    print(f"a change is said to pay on {false} of {len(args.floors)} floors; {tried} were tried")


def main(arguments: Sequence[str] | None = None) -> None:
    options = argparse.ArgumentParser(prog="python -m benchmarks.whatif.planted_faults", description=__doc__)
    options.add_argument("--floors", type=int, nargs="+", default=list(range(10)))
    options.add_argument("--seed", type=int, default=51)
    options.add_argument("--minutes", type=float, default=45.0)
    options.add_argument("--seeds", type=int, default=4, help="of the model, with and without each change")
    options.add_argument("--faultless", action="store_true", help="the floors without their faults")
    args = options.parse_args(arguments)
    args.jobs = 1
    if args.faultless:
        _print_false(args)
        return
    every = []
    for number in args.floors:
        floor = planted_floor(number)
        print(f"Floor {number}: {floor.fault}, at {floor.place}", flush=True)
        every.append(found(floor, args.seed + number, args))
        print(f"  {every[-1]}", flush=True)
    for name, values in zip(Found._fields, zip(*every, strict=True), strict=True):
        print(f"{name} found in {sum(values)} of {len(values)} floors")
    print(f"all three in {sum(map(all, every))} of {len(every)} floors")


if __name__ == "__main__":
    main()
