"""Floors of several kinds and seeds through the service, without some of its parts, and the believer of paths."""

import json
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from benchmarks.planned_floors.comparison.service_parts import PARTS, unchanged
from benchmarks.planned_floors.comparison.service_replay import replayed
from benchmarks.planned_floors.floors.kinds import MadeOf, made_of, simulate
from benchmarks.planned_floors.logs.recording import MADE
from benchmarks.planned_floors.scoring.alerts import BELIEVER, SERVICE, alerts_of_revisions
from benchmarks.planned_floors.scoring.all_figures import figures
from benchmarks.planned_floors.scoring.figure import Figure
from benchmarks.planned_floors.scoring.judged_cases import Cases
from benchmarks.planned_floors.scoring.scored_floor import Floor
from benchmarks.planned_floors.truth.floor_truth import LOG
from deconflict.site import DEFAULT

Comparison = dict[str, dict[str, Figure]]
"""By service, its figures."""


@dataclass(frozen=True, slots=True)
class Plan:
    """What is compared, and how it is scored."""

    kinds: Sequence[str]
    seeds: Sequence[int]
    floors: Path
    """Where floors are kept; those that are there already are not made again."""
    clearance_m: float
    seconds: float | None = None
    """Length of each floor, where it is not its kind's own."""
    interval_s: float | None = None
    """Between reports, where it is not the kind's own."""
    after_s: float = 0.0
    """What happens sooner after the beginning of a floor is not scored."""
    parts: Sequence[str] = ()
    """Parts of the service to switch off, one by one."""


def compared(plan: Plan, jobs: int) -> Iterator[tuple[str, Comparison, dict[int, Comparison]]]:
    """By kind, the figures over all its seeds, and by seed."""
    with ProcessPoolExecutor(jobs) as pool:
        due = {(kind, seed): pool.submit(floor_cases, plan, kind, seed) for kind in plan.kinds for seed in plan.seeds}
        for kind in plan.kinds:
            by_seed = {seed: due[kind, seed].result() for seed in plan.seeds}
            services = next(iter(by_seed.values()))
            joined = {name: Cases.joined([cases[name] for cases in by_seed.values()]) for name in services}
            yield kind, _figures(joined), {seed: _figures(cases) for seed, cases in by_seed.items()}


def floor_cases(plan: Plan, kind: str, seed: int) -> dict[str, Cases]:
    """By service, the judged cases of one floor."""
    directory = plan.floors / f"{kind}-{seed}"
    make(made_of(kind, seed, plan.seconds, plan.interval_s), directory)
    return log_cases(directory / LOG, directory, plan.clearance_m, plan.after_s, plan.parts)


def log_cases(
    log: Path, truth: Path, clearance_m: float, after_s: float = 0.0, parts: Sequence[str] = ()
) -> dict[str, Cases]:
    """By service, the judged cases of one log."""
    floor = Floor.read(log, truth, clearance_m, after_s)
    site = DEFAULT.model_copy(update={"conflict": DEFAULT.conflict.model_copy(update={"clearance_m": clearance_m})})
    changes = {SERVICE: unchanged} | {f"without {name}": PARTS[name] for name in parts}
    found = {BELIEVER: floor.believer()}
    for name, published in replayed(log, site, changes).items():
        found[name] = floor.cases(alerts_of_revisions(published.revisions, floor.end_s), published.samples)
    return found


def make(floor: MadeOf, directory: Path) -> None:
    """Simulate a floor into a directory, unless that holds the same floor already."""
    made = json.loads(json.dumps(asdict(floor)))
    kept = directory / MADE
    if not kept.is_file() or json.loads(kept.read_text()) != made:
        simulate(floor).save(directory, made)


def _figures(cases: Mapping[str, Cases]) -> Comparison:
    return {name: figures(of_service) for name, of_service in cases.items()}


def document(kind: str, whole: Comparison, by_seed: Mapping[int, Comparison]) -> dict[str, Any]:
    """For the JSON file."""
    return {"kind": kind, "whole": whole, "seeds": {str(seed): figures for seed, figures in by_seed.items()}}
