"""How right `deconflict whatif` is: `python -m benchmarks.whatif --log-seeds 31 32 --truth-seeds 18`.

Logs of the demo's halls, of yards with a dock or a lane, and of floors with another planner, as they are, are asked
about changes. Beside each answer is what the change truly does: the mean over many seeds of the floor with the change
really made, less that of the floor as it is.
"""

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from benchmarks.whatif.changed_halls import (
    HallChange,
    mean_change,
    recorded_hall,
    standard_error,
    true_figures,
)
from benchmarks.whatif.dock_yard import DOCK, dock_yard
from benchmarks.whatif.lane_yard import LANE, LaneChange, lane_yard
from benchmarks.whatif.one_way_cells import AISLE, KINDS, cell_figures, recorded_cells
from benchmarks.whatif.yards import recorded_yard, yard_figures
from deconflict.settings.site import Site
from deconflict.settings.site_file import load
from deconflict.simulation.demo.demo_site import demo_site
from metrics.whatif.answer import FigureAnswer, WhatIfAnswer, WhatIfModel
from metrics.whatif.change import Change, named_outlines, one_way, priority, slow_zone, wider
from metrics.whatif.demand import Demand, demand_of
from metrics.whatif.more_docks import more_docks
from metrics.whatif.simulated.model_runs import FloorFigures

CHANGES = (
    HallChange("Aisle 4 one-way", one_way_x_m=38.5),
    HallChange("Aisle 7 one-way", one_way_x_m=71.5),
    HallChange("Lower cross aisle at 0.6", place="Lower cross aisle", share=0.6),
    HallChange("Upper cross aisle at 0.6", place="Upper cross aisle", share=0.6),
    HallChange("Aisle 3 at 0.5", place="Aisle 3", share=0.5),
    HallChange("Alder first", first="Alder"),
    HallChange("Basalt first", first="Basalt"),
    HallChange("Corvid first", first="Corvid"),
)
AS_IT_IS = HallChange("as it is")
YARD_ROBOTS = (5, 6)
LANE_ROBOTS, WIDER_M = 3, 2.0
LANE_CHANGES = {
    "lane one-way": LaneChange(one_way=True),
    "lane 2 m wider": LaneChange(wider_m=WIDER_M),
    "lane 2 m wider, robots keep right": LaneChange(wider_m=WIDER_M, two_lanes=True),
}
SIGN_CLEAR = 2.0
"""The true change has a sign if it is this many of its standard errors."""


@dataclass(frozen=True, slots=True)
class ComparedFigure:
    """One figure of one answer, and its truth."""

    change: str
    figure: str
    answer: FigureAnswer
    true: float
    error: float
    """Standard error of the true change."""

    @property
    def holds(self) -> bool:
        """Whether the interval holds the true change, within its error."""
        return self.answer.low - self.error <= self.true <= self.answer.high + self.error

    def line(self) -> str:
        answer = self.answer
        predicted = f"{answer.change:+6.0f} ({answer.low:+.0f} to {answer.high:+.0f})"
        truth = f"true {self.true:+6.0f} +- {self.error:3.0f}  {'held' if self.holds else 'not held'}"
        return f"{self.change:26} {self.figure:8} {predicted:28} {truth}"


def changes_of(site: Site, floors: Sequence[str], demand: Demand) -> Iterator[tuple[HallChange, Change]]:
    """Each change as it is made and as it is asked."""
    for made in CHANGES:
        if made.first:
            yield made, priority(made.first, demand)
        elif made.one_way_x_m is None:
            yield made, slow_zone(named_outlines(site, floors, made.place), made.share)
        else:
            [aisle] = named_outlines(site, floors, made.name.removesuffix(" one-way"))
            asked = one_way(aisle, demand)
            yield made.towards(1.0 if "larger" in asked.text else -1.0), asked


def compared(
    name: str, answers: Mapping[str, FigureAnswer], before: Sequence[FloorFigures], after: Sequence[FloorFigures]
) -> Iterator[ComparedFigure]:
    for figure, answer in answers.items():
        truth = mean_change(before, after, figure), standard_error(before, after, figure)
        yield ComparedFigure(name, figure, answer, *truth)


def main(arguments: Sequence[str] | None = None) -> None:
    options = argparse.ArgumentParser(prog="python -m benchmarks.whatif", description=__doc__)
    options.add_argument("--floors", nargs="+", choices=FLOORS, default=list(FLOORS))
    options.add_argument("--robots", type=int, default=60, help="of the halls")
    options.add_argument("--minutes", type=float, default=10.0)
    options.add_argument("--log-seeds", type=int, nargs="+", default=[31, 32])
    options.add_argument("--truth-seeds", type=int, default=18, help="runs of the floor with the change really made")
    options.add_argument("--runs", type=int, default=6, help="of the model, with and without each change")
    options.add_argument("--jobs", type=int, default=1)
    options.add_argument("--json", type=Path, metavar="OUT.json")
    args = options.parse_args(arguments)
    rows = [row for name in args.floors for row in FLOORS[name](args)]
    for figure in fields(FloorFigures):
        print(_summary(figure.name, [row for row in rows if row.figure == figure.name]))
    if args.json:
        args.json.write_text(json.dumps([_row(row) for row in rows], indent=2) + "\n")


def _halls(args: argparse.Namespace) -> Iterator[ComparedFigure]:
    """The answers about the demo's halls."""
    site, truths = load(demo_site()), dict[HallChange, list[FloorFigures]]()
    for seed in args.log_seeds:
        recorded = recorded_hall(args.robots, seed, 60 * args.minutes)
        demand = demand_of(recorded)
        model = WhatIfModel(recorded, demand, args.runs, args.jobs)
        for made, asked in changes_of(site, recorded.floors, demand):
            for change in {AS_IT_IS, made} - truths.keys():
                truths[change] = _truth(args, site, recorded.floors, change)
            yield from _shown(seed, made.name, model.ask(asked), truths[AS_IT_IS], truths[made])


def _yard(args: argparse.Namespace) -> Iterator[ComparedFigure]:
    """The answers about one more dock of a yard."""
    seconds, seeds = 60 * args.minutes, range(1, args.truth_seeds + 1)
    for robots in YARD_ROBOTS:
        before, after = ([yard_figures(dock_yard(robots, docks), seed, seconds) for seed in seeds] for docks in (1, 2))
        for seed in args.log_seeds:
            recorded = recorded_yard(dock_yard(robots, 1), seed, seconds)
            demand = demand_of(recorded)
            answer = WhatIfModel(recorded, demand, args.runs, args.jobs).ask(more_docks([DOCK], demand))
            yield from _shown(seed, f"one more dock, {robots} robots", answer, before, after)


def _lanes(args: argparse.Namespace) -> Iterator[ComparedFigure]:
    """The answers about a narrow lane that is one-way or wider."""
    seconds, seeds = 60 * args.minutes, range(1, args.truth_seeds + 1)

    def truth(change: LaneChange) -> list[FloorFigures]:
        return [yard_figures(lane_yard(LANE_ROBOTS, change), seed, seconds) for seed in seeds]

    before, truths = truth(LaneChange()), {name: truth(change) for name, change in LANE_CHANGES.items()}
    for seed in args.log_seeds:
        recorded = recorded_yard(lane_yard(LANE_ROBOTS), seed, seconds)
        demand = demand_of(recorded)
        model = WhatIfModel(recorded, demand, args.runs, args.jobs)
        for name, change in LANE_CHANGES.items():
            if change.one_way:
                asked = one_way(LANE, demand)
                asked = asked if "larger" in asked.text else one_way(LANE, demand, reverse=True)
            else:
                asked = wider([LANE], demand, recorded.losses, change.wider_m)
            yield from _shown(seed, name, model.ask(asked), before, truths[name])


def _cells(args: argparse.Namespace) -> Iterator[ComparedFigure]:
    """The answers about a one-way aisle of floors of cells."""
    seconds, seeds = 60 * args.minutes, range(1, args.truth_seeds + 1)
    for kind in KINDS:
        before, after = ([cell_figures(kind, seed, seconds, one_way=way) for seed in seeds] for way in (False, True))
        for seed in args.log_seeds:
            recorded = recorded_cells(kind, seed, seconds, one_way=False)
            demand = demand_of(recorded)
            asked = one_way(AISLE, demand)
            if "smaller" not in asked.text:
                asked = one_way(AISLE, demand, reverse=True)
            answer = WhatIfModel(recorded, demand, args.runs, args.jobs).ask(asked)
            yield from _shown(seed, f"aisle one-way, {kind}", answer, before, after)


def _shown(
    seed: int, name: str, answer: WhatIfAnswer, before: Sequence[FloorFigures], after: Sequence[FloorFigures]
) -> Iterator[ComparedFigure]:
    """The figures of an answer beside their truth, printed."""
    sums = [f"{figure} {found.model:.0f} in the log {found.log:.0f}" for figure, found in answer.figures.items()]
    print(f"log {seed}, {name}: {', '.join(sums)}; {'; '.join(answer.problems) or 'answered'}")
    for row in compared(name, answer.figures, before, after):
        print(row.line(), flush=True)
        yield row


def _summary(figure: str, rows: Sequence[ComparedFigure]) -> str:
    clear = [row for row in rows if abs(row.true) > SIGN_CLEAR * row.error]
    right = sum(row.true * row.answer.change > 0 for row in clear)
    holds = f"interval holds the true change {sum(row.holds for row in rows)} of {len(rows)}"
    return f"{figure:8} {holds}, sign right in {right} of {len(clear)} clear changes"


def _truth(args: argparse.Namespace, site: Site, floors: Sequence[str], change: HallChange) -> list[FloorFigures]:
    seeds = range(1, args.truth_seeds + 1)
    return [true_figures(args.robots, seed, 60 * args.minutes, change, site, floors) for seed in seeds]


def _row(row: ComparedFigure) -> dict[str, Any]:
    answer = row.answer
    return {
        "change": row.change,
        "figure": row.figure,
        "predicted": [answer.change, answer.low, answer.high],
        "true": [round(row.true, 1), round(row.error, 1)],
        "holds": row.holds,
    }


FLOORS = {"halls": _halls, "yard": _yard, "lane": _lanes, "cells": _cells}

if __name__ == "__main__":
    main()
