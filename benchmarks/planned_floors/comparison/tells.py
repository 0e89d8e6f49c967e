"""The same floors with robots that report more or less: what the service and the path believer make of each.

Each floor is made once. Its log is then reduced (`logs/reduced_log.py`), so that only the reports differ.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from benchmarks.planned_floors.comparison.compare import floor_cases, make
from benchmarks.planned_floors.floors.kinds import made_of
from benchmarks.planned_floors.logs.reduced_log import TELLS, reduce_log
from benchmarks.planned_floors.logs.reports import robots_in_file
from benchmarks.planned_floors.scoring.alerts import BELIEVER, SERVICE
from benchmarks.planned_floors.scoring.all_figures import figures
from benchmarks.planned_floors.scoring.figure import Figure
from benchmarks.planned_floors.scoring.judged_cases import Cases
from benchmarks.planned_floors.scoring.markdown import aligned, cell
from benchmarks.planned_floors.scoring.scored_floor import Floor
from benchmarks.planned_floors.truth.floor_truth import LOG

TOLD, ANY, TRUE, HOURLY = "outcomes told 2 s", "outcomes any alert", "alerts true", "alerts per robot-hour"
SHOWN = (TOLD, ANY, TRUE, HOURLY)
SERVICES = (SERVICE, BELIEVER)
ByTells = dict[str, dict[str, dict[str, Figure]]]
"""By what robots tell (a name of `TELLS`), and by service, the figures in `SHOWN`."""


@dataclass(frozen=True, slots=True)
class KeptFloor:
    """A floor that others made: its log and its truth."""

    log: Path
    truth: Path

    @property
    def name(self) -> str:
        """That of its log, or of its directory if `make` wrote it."""
        return self.log.parent.name if self.log.name == LOG else self.log.name.split(".jsonl")[0]


@dataclass(frozen=True, slots=True)
class Plan:
    """The compared floors and reports."""

    kinds: Sequence[str]
    seeds: Sequence[int]
    kept: Sequence[KeptFloor]
    """Each is scored beside the kinds, under its own name."""
    tells: Sequence[str]
    """Names of `TELLS`."""
    floors: Path
    """Directory of the floors and of the reduced logs. Existing floors are not made again."""
    clearance_m: float
    seconds: float | None = None
    """Length of each floor. None for that of its kind."""
    after_s: float = 0.0
    """Events earlier than this after the start of a floor are not scored."""


def told(plan: Plan) -> Iterator[tuple[str, ByTells]]:
    """Yields the figures of each kind and of each kept floor, as soon as they are known."""
    for kind in plan.kinds:
        yield kind, _joined([_cases(plan, _made(plan, kind, seed), f"{kind}-{seed}") for seed in plan.seeds])
    for kept in plan.kept:
        yield kept.name, _joined([_cases(plan, kept, kept.name)])


def _made(plan: Plan, kind: str, seed: int) -> KeptFloor:
    directory = plan.floors / f"{kind}-{seed}"
    make(made_of(kind, seed, plan.seconds), directory)
    return KeptFloor(directory / LOG, directory)


def _cases(plan: Plan, kept: KeptFloor, name: str) -> dict[str, dict[str, Cases]]:
    """By what robots tell, and by service, the judged cases of one floor."""
    floor, found = Floor.read(kept.log, kept.truth, plan.clearance_m, plan.after_s), {}
    for tells in plan.tells:
        reduced = plan.floors / f"{name}-tells" / f"{tells}.jsonl.gz"
        reduced.parent.mkdir(parents=True, exist_ok=True)
        reduce_log(kept.log, TELLS[tells], reduced)
        found[tells] = floor_cases(replace(floor, robots=robots_in_file(reduced)), reduced)
    return found


def _joined(floors: Sequence[Mapping[str, Mapping[str, Cases]]]) -> ByTells:
    """The figures over all floors of a kind."""
    return {
        tells: {service: _figures(Cases.joined([floor[tells][service] for floor in floors])) for service in SERVICES}
        for tells in floors[0]
    }


def _figures(cases: Cases) -> dict[str, Figure]:
    found = figures(replace(cases, probabilities=cases.probabilities[:0]))
    return {name: found[name] for name in SHOWN}


def document(by_kind: Mapping[str, ByTells], plan: Plan) -> dict[str, Any]:
    """The figures as a JSON document, which `baseline` reads."""
    return {"seeds": list(plan.seeds), "seconds": plan.seconds, "kinds": dict(by_kind)}


def baseline(path: Path) -> dict[str, ByTells]:
    """The figures of another release by kind, from a document that this command wrote there."""
    kinds: dict[str, ByTells] = json.loads(path.read_text())["kinds"]
    return kinds


def table_of_tells(by_tells: ByTells, before: ByTells | None = None) -> str:
    """A Markdown table: a row for what robots tell; the figures of the service, of the baseline, of the believer."""
    columns = {SERVICE: (by_tells, SERVICE), "baseline": (before or {}, SERVICE), BELIEVER: (by_tells, BELIEVER)}
    if before is None:
        del columns["baseline"]
    heading = [f"{name}: {figure}" for name in columns for figure in SHOWN]
    rows = [["robots tell", "outcomes", *heading]]
    for tells, services in by_tells.items():
        cells = [
            cell(of.get(tells, {}).get(service, {}).get(figure)) for of, service in columns.values() for figure in SHOWN
        ]
        rows.append([tells, str(services[SERVICE][TOLD]["of"]), *cells])
    return aligned(rows)
