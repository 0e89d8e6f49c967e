"""A replay: log -> passes -> engines -> scores.

`PassReader` turns the messages of a recorded log into the passes that the engine makes. An `EngineRun` for each
clearance runs the engine of the live service over these passes, and joins its advisories into situations. `LogScores`
compares the output with what happened.
"""

import time
from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from typing import Any, TypedDict

from deconflict.operator.blackbox.start_state import StartState
from deconflict.settings.site import Site
from deconflict_client.advisory import AnyAdvisory
from deconflict_client.situations import Situation
from ingest.batch import Batch
from ingest.recording.log_reader import Event, LogReader
from metrics.replay import conformance_counts
from metrics.replay.engine_output import PairProbabilities
from metrics.replay.engine_run import EngineRun
from metrics.replay.log_scores import LogScores
from metrics.replay.recorded_passes import PassReader

AdvisorySink = Callable[[float, AnyAdvisory], None]
"""Called with a clearance, and a revision of its engine."""
SituationSink = Callable[[Situation], None]
BatchSink = Callable[[float, Batch], None]
ProbabilitySink = Callable[[float, PairProbabilities], None]
"""Called with the time of a pass, and the probability of every pair that is worth a look."""


class Sinks(TypedDict, total=False):
    """What a replay calls with what it publishes."""

    on_advisory: AdvisorySink
    on_situation: SituationSink
    on_batch: BatchSink
    on_probabilities: ProbabilitySink


def replay(
    reader: LogReader,
    events: Iterable[Event],
    site: Site,
    clearances_m: Sequence[float],
    *,
    on_advisory: AdvisorySink | None = None,
    on_situation: SituationSink | None = None,
    on_batch: BatchSink | None = None,
    on_probabilities: ProbabilitySink | None = None,
    start: StartState = StartState(),  # noqa: B008 - frozen
) -> dict[str, Any]:
    """The scores of every clearance over the events that `reader` reads.

    `on_advisory` is called with each revision that the live stream would have published, in that order; their `seq`
    is 0. `on_situation` is called with each revision of a situation of the first clearance. `on_batch` is called with
    the time and the batch of each pass, `on_probabilities` once a second with those of the first clearance. `start` is
    the engine's state at the start of a black box. Only `speed_x_real_time` differs between two runs.
    """
    began = time.perf_counter()
    passes = PassReader(site)
    engines = [EngineRun(site, clearance_m, start) for clearance_m in clearances_m]
    scores = LogScores(site, clearances_m)
    for engine_pass in chain(passes.passes_of(events), passes.last_passes()):
        if on_batch:
            on_batch(engine_pass.now_s, engine_pass.batch)
        outputs = [engine.advance(engine_pass) for engine in engines]
        scores.add(engine_pass, outputs)
        if on_advisory:
            for clearance_m, output in zip(clearances_m, outputs, strict=True):
                for revision in output.advisories:
                    on_advisory(clearance_m, revision)
        if on_situation:
            for situation in outputs[0].situations:
                on_situation(situation)
        if on_probabilities and outputs[0].probabilities:
            on_probabilities(engine_pass.now_s, outputs[0].probabilities)
    return _document(scores.result(passes, engines[0].measures()), reader, time.perf_counter() - began)


def _document(result: dict[str, Any], reader: LogReader, took_s: float) -> dict[str, Any]:
    """A result together with how fast it was computed and what of the log could not be read."""
    return {
        "messages": result["messages"],
        "robots": result["robots"],
        "span_s": result["span_s"],
        "speed_x_real_time": result["span_s"] / took_s,
        **conformance_counts.lines(reader),
        **result,
    }
