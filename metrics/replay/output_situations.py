"""Situations over the advisories of the engines: the step between an engine and what is published."""

from collections.abc import Sequence
from dataclasses import replace

from deconflict.advisories.situations.situation import advisories_of, situations_of
from deconflict.advisories.situations.situation_lifecycle import SituationLifecycle
from deconflict.engine.place_names import PlaceNames
from deconflict.operator.blackbox.start_state import StartState
from deconflict.settings.site import Site
from metrics.replay.engine_output import EngineOutput


class OutputSituations:
    """Joins the advisories of each clearance's engine into situations. No engine depends on them."""

    def __init__(self, site: Site, engines: int, start: StartState) -> None:
        self._lifecycles = [SituationLifecycle(PlaceNames.of(site).describe) for _ in range(engines)]
        for lifecycle in self._lifecycles:
            lifecycle.restore((), start.open)

    def published(self, now_s: float, outputs: Sequence[EngineOutput]) -> list[EngineOutput]:
        """The outputs of all engines at one pass, with situations, and with the situation of each advisory."""
        return [
            _with_situations(lifecycle, now_s, output)
            for lifecycle, output in zip(self._lifecycles, outputs, strict=True)
        ]


def _with_situations(lifecycle: SituationLifecycle, now_s: float, output: EngineOutput) -> EngineOutput:
    published = lifecycle.published(now_s, list(output.advisories))
    return replace(output, advisories=advisories_of(published), situations=situations_of(published))
