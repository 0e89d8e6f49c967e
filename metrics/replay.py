"""A recorded log through the engine that the live service uses, and what became of its advisories."""

import time
from collections.abc import Iterable, Iterator
from math import floor, inf
from pathlib import Path
from typing import Any

from deconflict.advisory import AdvisoryState, AnyAdvisory, ConflictAdvisory
from deconflict.engine import Engine
from deconflict.roles.receiver import fleet_of
from deconflict.site import Site
from ingest.fleet import Fleet
from ingest.measures import Measures
from ingest.playback import EngineStarted, Event, Reader, Received, Tick
from metrics.scoring import Alert, score
from metrics.truth import Report, Truth

TICK_S = 0.25
"""Between passes over a log that has no ticks of its own."""


def with_ticks(events: Iterable[Event]) -> Iterator[Event]:
    """The events, with ticks at whole multiples of `TICK_S` among them where the log has none."""
    last: int | None = None
    for event in events:
        if isinstance(event, Tick):
            last = -1
        if isinstance(event, Received) and last != -1:
            now = floor(event.arrival_s / TICK_S)
            if last is not None:
                # a gap in the recording is not stepped through
                yield from (Tick(step * TICK_S) for step in range(max(last, now - 400) + 1, now + 1))
            last = now
        yield event


class Run:
    """One clearance's engine over one log."""

    def __init__(self, site: Site, clearance_m: float) -> None:
        conflict = site.conflict.model_copy(update={"clearance_m": clearance_m})
        self.clearance_m = clearance_m
        self.engine = Engine(site.model_copy(update={"conflict": conflict}))
        self.alerts: dict[str, list[ConflictAdvisory]] = {}

    def take(self, revisions: Iterable[AnyAdvisory]) -> None:
        for one in revisions:
            if isinstance(one, ConflictAdvisory):
                self.alerts.setdefault(one.id, []).append(one)


def replay(logs: Iterable[Path], site: Site, clearances_m: Iterable[float]) -> tuple[dict[str, Any], list[Run]]:
    """Scores of every clearance, and the runs that they come from."""
    runs = [Run(site, clearance_m) for clearance_m in clearances_m]
    fleet, reader = fleet_of(site, Measures()), Reader()
    truth = Truth([run.clearance_m for run in runs])
    messages, first_s, last_s, began = 0, inf, -inf, time.perf_counter()
    everything = False
    for event in with_ticks(reader.read(logs)):
        if isinstance(event, Received):
            messages += 1
            first_s, last_s = min(first_s, event.arrival_s), max(last_s, event.arrival_s)
            if not event.refused:
                fleet.receive(event.raw, event.arrival_s, event.connection)
        elif isinstance(event, EngineStarted):
            everything = True
        elif isinstance(event, Tick):
            batch = fleet.cut(event.now_s, everything)
            everything = False
            _tell_truth(truth, fleet, batch.robots)
            truth.advance(event.now_s)
            for run in runs:
                run.engine.receive(batch)
                run.take(run.engine.step(event.now_s))
    truth.finish()
    took_s = time.perf_counter() - began
    span_s = max(last_s - first_s, 0.0)
    result = {
        "messages": messages,
        "unreadable_lines": reader.unreadable,
        "robots": len(fleet.documents(last_s)),
        "span_s": span_s,
        "speed_x_real_time": span_s / took_s,
        "scores": [
            score(truth.encounters(run.clearance_m), list(_alerts(run, truth)), run.clearance_m) for run in runs
        ],
    }
    return result, runs


def advisory_lines(runs: Iterable[Run]) -> Iterator[dict[str, Any]]:
    """Every revision of every run as an event, by time."""
    revisions = [one for run in runs for told in run.alerts.values() for one in told]
    for one in sorted(revisions, key=lambda each: (each.updated_at, each.clearance_m, each.id)):
        yield {
            "event": one.state.value,
            "at": one.updated_at.isoformat(),
            "id": one.id,
            "robots": list(one.robots),
            "clearance_m": one.clearance_m,
            "severity": one.severity.value,
            "time_to_conflict_s": one.time_to_conflict_s,
            "min_separation_m": one.min_separation_m,
        }


def _tell_truth(truth: Truth, fleet: Fleet, robots: Iterable[str]) -> None:
    for uuid in robots:
        forecast = fleet.robots[uuid].forecast
        if forecast:
            t_s, x_m, y_m, yaw_rad = forecast.knots[0]
            report = Report(t_s, forecast.floors[0], x_m, y_m, yaw_rad, forecast.length_m, forecast.width_m)
            truth.report(uuid, report)


def _alerts(run: Run, truth: Truth) -> Iterator[Alert]:
    for revisions in run.alerts.values():
        first, last = revisions[0], revisions[-1]
        cleared_s = last.updated_at.timestamp() if last.state is AdvisoryState.CLEARED else inf
        ahead = [one for one in revisions if one.time_to_conflict_s > 0] or [first]
        yield Alert(
            first.robots,
            first.vendors,
            first.raised_at.timestamp(),
            cleared_s,
            ahead[-1].predicted_at.timestamp(),
            min(truth.last_seen_s(robot) for robot in first.robots),
        )
