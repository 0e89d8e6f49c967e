"""The service over one log: its advisories and its probabilities."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

from benchmarks.planned_floors.comparison.service_parts import Change
from benchmarks.planned_floors.scoring.judged_cases import Sample
from deconflict.operator.blackbox.start_state import StartState
from deconflict.settings.site import Site
from ingest.recording.log_reader import LogReader
from metrics.replay.engine_run import EngineRun
from metrics.replay.recorded_passes import EnginePass, PassReader


@dataclass(slots=True)
class Published:
    """Everything that one engine published over a log."""

    revisions: list[dict[str, Any]] = field(default_factory=list)
    """Revisions, as `deconflict replay --advisories` writes them."""
    samples: list[Sample] = field(default_factory=list)
    """Probabilities, once a second."""
    lost_s: float = 0.0
    """Seconds that robots lost to each other, in losses that have ended or parts of long ones."""

    def add_pass(self, engine: EngineRun, engine_pass: EnginePass) -> None:
        """Run one pass of the engine and keep its output."""
        output = engine.advance(engine_pass)
        self.revisions += [revision.model_dump(mode="json") for revision in output.advisories]
        self.lost_s += sum(loss.lost_s for loss in output.losses)
        for (a, b), probability in output.probabilities:
            self.samples.append((min((a, b), (b, a)), engine_pass.now_s, probability))


def replayed(log: Path, site: Site, changes: Mapping[str, Change]) -> dict[str, Published]:
    """What the service published with each change, by name. Each engine starts without learned state."""
    reader = PassReader(site)
    engines = {name: EngineRun(site, site.conflict.clearance_m, StartState()) for name in changes}
    for name, change in changes.items():
        change(engines[name].engine)
    published = {name: Published() for name in changes}
    passes: Iterable[EnginePass] = chain(reader.passes_of(LogReader().read([log])), reader.last_passes())
    for engine_pass in passes:
        for name, engine in engines.items():
            published[name].add_pass(engine, engine_pass)
    return published
