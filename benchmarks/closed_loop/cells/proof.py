"""Whether advice saves what it says: `python -m benchmarks.closed_loop.cells.proof --floor scattered --seeds 21 22`.

Some requests are drawn. When one is given, the world is copied, and driven on for a minute with this request and
without it, and without any other from then on, with several draws of the stalls to come. The saving is the time that
all robots gain: the difference of what they drive, at their usual speed.
"""

import argparse
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from math import sqrt

import numpy as np

from benchmarks.closed_loop.cells.kinds import SIZES, VENDORS, floor_of
from benchmarks.closed_loop.cells.world import CellWorld
from benchmarks.planned_floors.floors.traffic import NOMINAL_MPS
from benchmarks.planned_floors.truth.motion import STEP_S
from deconflict.adviser import Adviser, Request

FROM_S, UNTIL_S, AHEAD_S = 60.0, 420.0, 60.0
DRAWN_SHARE = 0.08
"""Of the requests; the first are not those that a floor at its start has."""


@dataclass(frozen=True, slots=True)
class Proof:
    """A request, what it says that it saves, and what it saves."""

    verb: str
    stated_s: float
    stated_interval_s: tuple[float, float]
    measured_s: float
    """The mean over draws."""
    error_s: float
    """Its standard error."""

    @property
    def is_inside(self) -> bool:
        return self.stated_interval_s[0] <= self.measured_s <= self.stated_interval_s[1]


def driven_m(world: CellWorld, draw: int, request: Request | None) -> float:
    """How far all robots drive in `AHEAD_S` from now, with later stalls of their own."""
    copied = world.copied(draw)
    if request:
        copied.ask(request)
    way_m = 0.0
    for _ in range(round(AHEAD_S / STEP_S)):
        copied.step()
        way_m += float(copied.traffic.driving["speed_mps"].sum()) * STEP_S
    return way_m


def proof_of(world: CellWorld, request: Request, draws: int) -> Proof:
    saved_s = [(driven_m(world, draw, request) - driven_m(world, draw, None)) / NOMINAL_MPS for draw in range(draws)]
    interval_s = request.saving_interval_s or (0.0, 0.0)
    error_s = float(np.std(saved_s)) / sqrt(draws)
    return Proof(request.verb, request.saving_s or 0.0, interval_s, float(np.mean(saved_s)), error_s)


def proofs(kind: str, pieces: int, draws: int, seed: int) -> list[Proof]:
    """The proofs of at most `pieces` requests of one floor."""
    world, adviser, rng = CellWorld(floor_of(kind, seed, VENDORS)), Adviser(), np.random.default_rng([seed, 11])
    found: list[Proof] = []
    while world.since_s < UNTIL_S and len(found) < pieces:
        for _ in range(10):
            world.step()
        messages = world.heard()
        for name, answer, why in world.answers():
            adviser.answer(name, answer, why)  # type: ignore[arg-type]
        for request in adviser.hear(world.now_s, messages):
            is_drawn = world.since_s > FROM_S and not request.withdrawn and rng.random() < DRAWN_SHARE
            if is_drawn and len(found) < pieces:
                found.append(proof_of(world, request, draws))
            world.ask(request)
    return found


def lines(kind: str, found: Sequence[Proof]) -> Iterator[str]:
    for each in found:
        low_s, high_s = each.stated_interval_s
        stated = f"says {each.stated_s:5.1f} s ({low_s:.1f} to {high_s:.1f})"
        yield f"{kind} {each.verb:12} {stated}, saves {each.measured_s:5.1f} +- {each.error_s:.1f} s"
    stated_s, measured_s = sum(each.stated_s for each in found), sum(each.measured_s for each in found)
    positive, inside = (np.mean([each.measured_s > 0 for each in found]), np.mean([each.is_inside for each in found]))
    sums = f"{stated_s:.0f} s stated, {measured_s:.0f} s measured"
    yield f"{kind}: {len(found)} requests, {positive:.0%} save time, {inside:.0%} inside the interval; {sums}"


def main(arguments: Sequence[str] | None = None) -> None:
    options = argparse.ArgumentParser(
        prog="python -m benchmarks.closed_loop.cells.proof", description=(__doc__ or "").splitlines()[0]
    )
    options.add_argument("--floor", choices=SIZES, nargs="+", default=list(SIZES))
    options.add_argument("--seeds", type=int, nargs="+", default=[21, 22, 23, 24])
    options.add_argument("--pieces", type=int, default=6, help="most requests of a seed")
    options.add_argument("--draws", type=int, default=10)
    options.add_argument("--jobs", type=int, default=1)
    args = options.parse_args(arguments)
    with ProcessPoolExecutor(args.jobs) as processes:
        for kind in args.floor:
            found = processes.map(partial(proofs, kind, args.pieces, args.draws), args.seeds)
            for line in lines(kind, [each for of_seed in found for each in of_seed]):
                print(line, flush=True)


if __name__ == "__main__":
    main()
