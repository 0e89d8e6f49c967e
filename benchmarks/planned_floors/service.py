"""The service over one log: what it told, and the probabilities that it published."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

from benchmarks.planned_floors.cases import Sample
from benchmarks.planned_floors.parts import Change
from deconflict.blackbox.start import Start
from deconflict.site import Site
from ingest.playback import Reader
from metrics.passes import Pass, Reading
from metrics.replay import Run, streamed


@dataclass(slots=True)
class Told:
    """What one engine told of a log."""

    lines: list[dict[str, Any]] = field(default_factory=list)
    """Revisions, as `deconflict replay --advisories` writes them."""
    samples: list[Sample] = field(default_factory=list)
    """Probabilities, once a second."""

    def take(self, run: Run, one: Pass) -> None:
        """Let the engine make a pass."""
        said = run.step(one)
        self.lines += streamed([said])
        for (a, b), probability in said.probabilities:
            self.samples.append((min((a, b), (b, a)), one.now_s, probability))


def replayed(log: Path, site: Site, changes: Mapping[str, Change]) -> dict[str, Told]:
    """What the service told with each change, by name; each engine begins with nothing learned."""
    reading = Reading(site)
    runs = {name: Run(site, site.conflict.clearance_m, Start()) for name in changes}
    for name, change in changes.items():
        change(runs[name].engine)
    told = {name: Told() for name in changes}
    passes: Iterable[Pass] = chain(reading.take(Reader().read([log])), reading.finish())
    for one in passes:
        for name, run in runs.items():
            told[name].take(run, one)
    return told
