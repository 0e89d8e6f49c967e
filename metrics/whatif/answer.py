"""What a change would change, with intervals, and whether the model repeats the log well enough to say."""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from deconflict.runtime.worker_process import end_with_command
from ingest.batch import Floats
from metrics.scoring.bootstrap import SEED, interval
from metrics.whatif.change import NO_CHANGE, Change
from metrics.whatif.demand import Demand
from metrics.whatif.recorded_tracks import RecordedFloor
from metrics.whatif.simulated.model_runs import COUNTED_SHARE, FloorFigures, log_figures, model_figures
from metrics.whatif.simulated.simulated_plan import Planner, SimulatedPlan

LOST_WITHIN = (0.5, 2.0)
"""The model has to lose between these shares of what the log lost."""
TRIPS_WITHIN = (0.85, 1.15)
IMPOSSIBLE_SHARE = 0.05
"""Without a way for more of the changed trips than this there is no answer."""
LEAST_LOST_S_PER_HOUR = 60.0
"""Where less is lost in the log, there is nothing to compare."""
ASSUMES = (
    "Each robot drives its recorded trips in their order, stays as long as recorded, and brakes for others.",
    "Not known are people without devices, doors, what vendors' planners would do, and ways where nobody drove.",
    "The interval is the spread of the model's own runs. docs/what-if.md has how often it was right.",
)
NO_ANSWER = 3
"""Exit code if the model does not repeat the log."""
NAMES = {"lost_s": "lost to others", "trips": "trips", "delays": "times held up for 1 s or more"}


@dataclass(frozen=True, slots=True)
class FigureAnswer:
    """One figure, per hour."""

    log: float
    model: float
    """Mean of the runs without the change."""
    change: float
    low: float
    high: float

    @property
    def meaning(self) -> str:
        return "less" if self.high < 0 else "more" if self.low > 0 else "no clear change"


@dataclass(frozen=True, slots=True, eq=False)
class WhatIfAnswer:
    """The answer to one question."""

    change: str
    span_s: float
    seeds: int
    trips: int
    """Trips of the log that are driven again."""
    rerouted: int
    impossible: int
    figures: dict[str, FigureAnswer]
    problems: tuple[str, ...]
    """Why there is no answer; none if there is."""

    def document(self) -> dict[str, Any]:
        return asdict(self) | {"assumes": ASSUMES}

    def lines(self) -> list[str]:
        """The answer for a person."""
        minutes, lost, trips = self.span_s / 60, self.figures["lost_s"], self.figures["trips"]
        found = [f"If {self.change} ({minutes:.0f} min of log, {self.trips} trips, {self.seeds} runs each):"]
        repeats = f"lost to others {lost.model:.0f} s/h, in the log {lost.log:.0f}"
        repeats += f"; trips {trips.model:.0f}/h, in the log {trips.log:.0f}"
        if self.problems:
            found += [f"  no answer: {problem}" for problem in self.problems]
        else:
            found += [_line(NAMES[name], figure) for name, figure in self.figures.items()]
            if self.rerouted:
                found.append(f"  {self.rerouted} of {self.trips} trips take another way")
        return [*found, f"The model without the change: {repeats}", *ASSUMES]


class WhatIfModel:
    """The recorded demand, driven again with several seeds. Questions are asked about it."""

    def __init__(self, floor: RecordedFloor, demand: Demand, seeds: int, jobs: int) -> None:
        self._demand, self._seeds, self._jobs = demand, range(1, seeds + 1), jobs
        self._span_s = floor.span_s
        self._until_s = COUNTED_SHARE * floor.span_s
        self._log = log_figures(floor, demand, self._until_s)
        self._before: Floats | None = None

    def ask(self, change: Change) -> WhatIfAnswer:
        """What a change would change."""
        plan = Planner(change.demand(self._demand)).plan(change)
        before, after = self._compared(change, plan)
        figures = self._figures(before, after)
        return WhatIfAnswer(
            change=change.text,
            span_s=round(self._span_s, 1),
            seeds=len(self._seeds),
            trips=sum(len(robot.trips) for robot in self._demand.robots),
            rerouted=plan.rerouted,
            impossible=plan.impossible,
            figures=figures,
            problems=tuple(_problems(figures, plan)),
        )

    def _compared(self, change: Change, plan: SimulatedPlan) -> tuple[Floats, Floats]:
        """(seeds, n, 3) without and with a change."""
        if change.before is None and self._before is not None:
            return self._before, self._driven([plan])[0]
        before, after = self._driven([Planner(self._demand).plan(change.before or NO_CHANGE), plan])
        if change.before is None:
            self._before = before
        return before, after

    def _driven(self, plans: Sequence[SimulatedPlan]) -> list[Floats]:
        """(seeds, n, 3) for each plan."""
        tasks = [(plan, seed, self._until_s) for plan in plans for seed in self._seeds]
        if self._jobs == 1:
            found = [model_figures(*task) for task in tasks]
        else:
            with ProcessPoolExecutor(self._jobs, initializer=end_with_command) as pool:
                found = [run.result() for run in [pool.submit(model_figures, *task) for task in tasks]]
        seeds = len(self._seeds)
        return [np.array(found[first : first + seeds]) for first in range(0, len(found), seeds)]

    def _figures(self, before: Floats, after: Floats) -> dict[str, FigureAnswer]:
        per_hour = 3600.0 / self._until_s
        return {
            field.name: _figure(
                getattr(self._log, field.name) * per_hour, before[..., index] * per_hour, after[..., index] * per_hour
            )
            for index, field in enumerate(fields(FloorFigures))
        }


def _line(name: str, figure: FigureAnswer) -> str:
    change = f"{figure.change:+.0f} an hour ({figure.low:+.0f} to {figure.high:+.0f})"
    unit = " s" if name == NAMES["lost_s"] else ""
    return f"  {name:30} {change:34} of {figure.log:.0f}{unit}: {figure.meaning}"


def _figure(log: float, before: Floats, after: Floats) -> FigureAnswer:
    """The change of a figure, as large relative to the log as in the model relative to its own runs.

    `before` and `after` (seeds, n) are the shares of each robot. Draws of robots and of seeds give the interval: other
    robots and other moments would have given other figures.
    """
    model = float(before.sum(axis=1).mean())
    scale = log / model if model > 0 else 1.0
    by_robot = scale * (after - before).T
    low, high = interval(by_robot, _drawn_changes(by_robot.shape[1])) or (0.0, 0.0)
    return FigureAnswer(*(round(value, 1) for value in (log, model, float(by_robot.sum(axis=0).mean()), low, high)))


def _drawn_changes(seeds: int) -> Callable[[Floats], Floats]:
    """The change of each sample of robots (d, n, seeds), each with other seeds: (d,)."""
    rng = np.random.default_rng(SEED)

    def changes(samples: Floats) -> Floats:
        drawn = rng.integers(0, seeds, (len(samples), seeds))
        by_seed = samples.sum(axis=1)
        of_sample: Floats = np.take_along_axis(by_seed, drawn, axis=1).mean(axis=1)
        return of_sample

    return changes


def _problems(figures: dict[str, FigureAnswer], plan: SimulatedPlan) -> Iterable[str]:
    lost, trips = figures["lost_s"], figures["trips"]
    if lost.log < LEAST_LOST_S_PER_HOUR:
        yield f"robots lose only {lost.log:.0f} s an hour to each other in the log, too little to compare"
    elif not LOST_WITHIN[0] <= lost.model / lost.log <= LOST_WITHIN[1]:
        yield f"the model loses {lost.model:.0f} s an hour, the log {lost.log:.0f}: it does not repeat this floor"
    if not trips.log or not TRIPS_WITHIN[0] <= trips.model / trips.log <= TRIPS_WITHIN[1]:
        yield f"the model drives {trips.model:.0f} trips an hour, the log {trips.log:.0f}"
    changed = plan.rerouted + plan.impossible
    if plan.impossible > IMPOSSIBLE_SHARE * max(changed, 1):
        yield f"{plan.impossible} of {changed} trips that would have to change have no other way where robots drove"
