"""A replay: log -> passes -> engines -> scores.

`PassReader` turns the messages of a recorded log into the passes that the engine makes. An `EngineRun` for each
clearance runs the engine of the live service over these passes. `LogScores` compares the output with what happened.
Each of the three has its own state, so that `dask_replay` can move them between machines.
"""

import time
from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from typing import Any, TypedDict

from deconflict.advisories.situations.situation import Situation
from deconflict.advisory import ConflictAdvisory
from deconflict.operator.blackbox.start_state import StartState
from deconflict.settings.site import Site
from ingest.batch import Batch
from ingest.recording.log_reader import Event, LogReader
from metrics.replay import conformance_counts
from metrics.replay.engine_output import EngineOutput
from metrics.replay.engine_run import EngineRun
from metrics.replay.log_scores import LogScores
from metrics.replay.recorded_passes import PassReader

AdvisoryLine = dict[str, Any]
"""One revision of a conflict advisory, as `replay --advisories` writes it."""
LineSink = Callable[[AdvisoryLine], None]
SituationSink = Callable[[Situation], None]
BatchSink = Callable[[float, Batch], None]


class Sinks(TypedDict, total=False):
    """What a replay calls with what it publishes."""

    on_line: LineSink
    on_situation: SituationSink
    on_batch: BatchSink


def replay(
    reader: LogReader,
    events: Iterable[Event],
    site: Site,
    clearances_m: Sequence[float],
    *,
    on_line: LineSink | None = None,
    on_situation: SituationSink | None = None,
    on_batch: BatchSink | None = None,
    start: StartState = StartState(),  # noqa: B008 - frozen
) -> dict[str, Any]:
    """The scores of every clearance over the events that `reader` reads.

    `on_line` is called with each revision that the live stream would have published, in that order. `on_situation` is
    called with each revision of a situation of the first clearance. `on_batch` is called with the time and the batch of
    each pass. `start` is the engine's state at the start of a black box.
    `speed_x_real_time` is the only value that differs between two runs.
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
        if on_line:
            for line in advisory_lines(outputs):
                on_line(line)
        if on_situation:
            for revision in outputs[0].situations:
                on_situation(revision)
    result = scores.result(passes, engines[0].measures())
    return document(result, reader, time.perf_counter() - began)


def document(result: dict[str, Any], reader: LogReader, took_s: float) -> dict[str, Any]:
    """A result together with how fast it was computed and what of the log could not be read."""
    return {
        "messages": result["messages"],
        "robots": result["robots"],
        "span_s": result["span_s"],
        "speed_x_real_time": result["span_s"] / took_s,
        **conformance_counts.lines(reader),
        **result,
    }


def advisory_lines(outputs: Sequence[EngineOutput]) -> list[AdvisoryLine]:
    """The revisions that the live stream would have published at one pass, from the output of each engine."""
    revisions = [revision for output in outputs for revision in output.revisions]
    ordered = sorted(revisions, key=lambda revision: (revision.clearance_m, revision.id))
    return [advisory_line(revision) for revision in ordered]


def advisory_line(revision: ConflictAdvisory) -> AdvisoryLine:
    """One revision as an event."""
    return {
        "event": revision.state.value,
        "at": revision.updated_at.isoformat(),
        "id": revision.id,
        "robots": list(revision.robots),
        "clearance_m": revision.clearance_m,
        "probability": revision.probability,
        "severity": revision.severity.value,
        "time_to_conflict_s": revision.time_to_conflict_s,
        "min_separation_m": revision.min_separation_m,
        "summary": revision.summary,
    }
