"""Compares the service, the service without some of its parts, and the path believer on floors of several kinds."""

import json
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.planned_floors.comparison.service_parts import PARTS, unchanged
from benchmarks.planned_floors.comparison.service_replay import replayed
from benchmarks.planned_floors.floors.kinds import MadeOf, made_of, simulate
from benchmarks.planned_floors.logs.recording import MADE
from benchmarks.planned_floors.scoring.alerts import BELIEVER, SERVICE, alerts_of_revisions
from benchmarks.planned_floors.scoring.all_figures import figures
from benchmarks.planned_floors.scoring.figure import Figure
from benchmarks.planned_floors.scoring.judged_cases import Cases
from benchmarks.planned_floors.scoring.markdown import table
from benchmarks.planned_floors.scoring.scored_floor import Floor
from benchmarks.planned_floors.truth.floor_truth import LOG
from deconflict.settings.site import DEFAULT, Site

ByService = dict[str, dict[str, Figure]]
"""By service, its figures."""


@dataclass(frozen=True, slots=True)
class Plan:
    """The compared floors and services, and how they are scored."""

    kinds: Sequence[str]
    seeds: Sequence[int]
    floors: Path
    """Directory of the floors. Existing floors are not made again."""
    clearance_m: float
    seconds: float | None = None
    """Length of each floor. None for that of its kind."""
    report_every_s: Sequence[float | None] = (None,)
    """Times between a robot's reports. Each is compared separately. None for that of the kind."""
    after_s: float = 0.0
    """Events earlier than this after the start of a floor are not scored."""
    parts: Sequence[str] = ()
    """Parts of the service to switch off, one by one."""


class Setting(NamedTuple):
    """A setting whose floors are scored together, over all seeds."""

    kind: str
    report_every_s: float | None

    @property
    def name(self) -> str:
        """The name of its files."""
        return self.kind if self.report_every_s is None else f"{self.kind}-every-{self.report_every_s:g}s"


@dataclass(frozen=True, slots=True)
class Comparison:
    """The figures of the floors of one setting."""

    setting: Setting
    whole: ByService
    """The figures over all seeds."""
    by_seed: dict[int, ByService]

    def markdown(self) -> str:
        return f"{self.setting.name}, {len(self.by_seed)} floors\n\n{table(self.whole)}\n"

    def document(self) -> dict[str, Any]:
        """The comparison as a JSON document."""
        by_seed = {str(seed): by_service for seed, by_service in self.by_seed.items()}
        return {**self.setting._asdict(), "whole": self.whole, "seeds": by_seed}

    def save(self, directory: Path) -> None:
        """One table, as Markdown and as JSON, named after the setting."""
        directory.mkdir(parents=True, exist_ok=True)
        (directory / f"{self.setting.name}.md").write_text(self.markdown())
        (directory / f"{self.setting.name}.json").write_text(json.dumps(self.document(), indent=2) + "\n")


def compared(plan: Plan, jobs: int) -> Iterator[Comparison]:
    """Yields a comparison for each kind and report interval, as soon as all its seeds are scored."""
    settings = [Setting(kind, every_s) for kind in plan.kinds for every_s in plan.report_every_s]
    with ProcessPoolExecutor(jobs) as pool:
        due = {
            setting: {seed: pool.submit(setting_cases, plan, setting, seed) for seed in plan.seeds}
            for setting in settings
        }
        for setting in settings:
            by_seed = {seed: cases.result() for seed, cases in due.pop(setting).items()}
            services = next(iter(by_seed.values()))
            joined = {name: Cases.joined([cases[name] for cases in by_seed.values()]) for name in services}
            yield Comparison(setting, _figures(joined), {seed: _figures(cases) for seed, cases in by_seed.items()})


def setting_cases(plan: Plan, setting: Setting, seed: int) -> dict[str, Cases]:
    """By service, the judged cases of one floor."""
    directory = plan.floors / f"{setting.name}-{seed}"
    make(made_of(setting.kind, seed, plan.seconds, setting.report_every_s), directory)
    return log_cases(directory / LOG, directory, plan.clearance_m, plan.after_s, plan.parts)


def site_with(clearance_m: float) -> Site:
    """The default settings of the service with this clearance."""
    return DEFAULT.model_copy(update={"conflict": DEFAULT.conflict.model_copy(update={"clearance_m": clearance_m})})


def log_cases(
    log: Path, truth: Path, clearance_m: float, after_s: float = 0.0, parts: Sequence[str] = ()
) -> dict[str, Cases]:
    """By service, the judged cases of one log."""
    return floor_cases(Floor.read(log, truth, clearance_m, after_s), log, parts)


def floor_cases(floor: Floor, log: Path, parts: Sequence[str] = ()) -> dict[str, Cases]:
    """By service, the judged cases of a floor with this log, from which its robots were read."""
    changes = {SERVICE: unchanged} | {f"without {name}": PARTS[name] for name in parts}
    found = {BELIEVER: floor.believer()}
    for name, published in replayed(log, site_with(floor.clearance_m), changes).items():
        found[name] = floor.cases(alerts_of_revisions(published.revisions, floor.end_s), published.samples)
    return found


def make(floor: MadeOf, directory: Path) -> None:
    """Simulate a floor into a directory, unless that holds the same floor already."""
    made = json.loads(json.dumps(asdict(floor)))
    kept = directory / MADE
    if not kept.is_file() or json.loads(kept.read_text()) != made:
        simulate(floor).save(directory, made)


def _figures(cases: Mapping[str, Cases]) -> ByService:
    return {name: figures(of_service) for name, of_service in cases.items()}
