"""The service over one log: its advisories and its probabilities."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

from benchmarks.planned_floors.comparison.service_parts import Change
from benchmarks.planned_floors.scoring.judged_cases import Sample
from deconflict.operator.blackbox.start_state import Start
from deconflict.settings.site import Site
from ingest.recording.log_reader import Reader
from metrics.replay.engine_passes import Pass, Reading
from metrics.replay.replay import Run, streamed


@dataclass(slots=True)
class Published:
    """What one engine published of a log."""

    revisions: list[dict[str, Any]] = field(default_factory=list)
    """Revisions, as `deconflict replay --advisories` writes them."""
    samples: list[Sample] = field(default_factory=list)
    """Probabilities, once a second."""

    def take(self, run: Run, due: Pass) -> None:
        """Let the engine make a pass."""
        revised = run.step(due)
        self.revisions += streamed([revised])
        for (a, b), probability in revised.probabilities:
            self.samples.append((min((a, b), (b, a)), due.now_s, probability))


def replayed(log: Path, site: Site, changes: Mapping[str, Change]) -> dict[str, Published]:
    """What the service published with each change, by name; each engine begins with nothing learned."""
    reading = Reading(site)
    runs = {name: Run(site, site.conflict.clearance_m, Start()) for name in changes}
    for name, change in changes.items():
        change(runs[name].engine)
    published = {name: Published() for name in changes}
    passes: Iterable[Pass] = chain(reading.take(Reader().read([log])), reading.finish())
    for due in passes:
        for name, run in runs.items():
            published[name].take(run, due)
    return published
