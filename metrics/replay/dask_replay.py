"""A replay on a Dask cluster. The result has the same bytes as that of a single process.

This process reads the log and cuts it into windows. The engine of each clearance and the scores proceed from window to
window, each with its own state. So the engines work on one window while the next is read and the one before is scored.
A task receives its state as bytes and returns it as bytes. It changes nothing that another task holds, so the scheduler
may run it anywhere, and may repeat it if a worker is lost.
"""

import logging
import pickle
import sys
import time
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from itertools import chain
from operator import itemgetter
from threading import Lock
from typing import Any, NamedTuple, cast
from urllib.parse import urlsplit

from dask.distributed import Client, Future, LocalCluster, Security

from deconflict.advisories.situations.situation import Situation
from deconflict.advisory import AnyAdvisory
from deconflict.operator.blackbox.start_state import StartState
from deconflict.settings.site import Site
from deconflict.sweep.shapes.shape_table import SHAPES
from ingest.recording.log_reader import Event, LogReader, Received, Tick
from ingest.security.origin_check import is_loopback
from metrics.replay.engine_output import EngineOutput
from metrics.replay.engine_run import EngineRun
from metrics.replay.log_scores import LogScores
from metrics.replay.output_situations import OutputSituations
from metrics.replay.recorded_passes import EnginePass, PassReader
from metrics.replay.replay import AdvisorySink, BatchSink, SituationSink, advisory_rows, document

CONNECT_TIMEOUT_S = 10.0
WINDOW_S = 60.0
"""Length of a window in the log's time. A window takes some seconds to compute; passing the states takes a few percent
of that."""
AHEAD = 4
"""Windows in progress at once. Bounds the memory."""
DASHBOARD = ":0"
"""Any free port, because another replay may run on the same machine. Dask serves it even without bokeh."""

State = bytes
_TASK = Lock()
"""Held by a task of this process while it works. A worker may have several threads."""


class WindowOutput(NamedTuple):
    """What the live stream would have published in one window."""

    advisories: list[tuple[float, AnyAdvisory]]
    """Each with the clearance of its engine."""
    situations: list[Situation]
    """Those of the first clearance."""


class ClusterError(ValueError):
    """The cluster can't be reached. The message says what to change."""


@contextmanager
def cluster(address: str) -> Iterator[Client]:
    """A client of the scheduler at an address. If the address is empty, starts a cluster on this machine's cores."""
    logging.getLogger("distributed").setLevel(logging.ERROR)
    if address:
        _refuse_open(address)
        try:
            client = Client(address, timeout=CONNECT_TIMEOUT_S)  # type: ignore[no-untyped-call]
        except (OSError, ValueError) as error:
            raise ClusterError(f"no Dask scheduler answers at {address}: start one with `dask scheduler`") from error
        with client:
            yield client
        return
    security = Security.temporary()  # type: ignore[no-untyped-call]
    with (
        LocalCluster(  # type: ignore[no-untyped-call]
            threads_per_worker=1, dashboard_address=DASHBOARD, protocol="tls://", security=security
        ) as local,
        Client(local, security=security) as client,  # type: ignore[no-untyped-call]
    ):
        if find_spec("bokeh"):
            sys.stderr.write(f"dashboard: {client.dashboard_link}\n")
        yield client


def _refuse_open(address: str) -> None:
    """Raises `ClusterError` for a scheduler to which anybody on the network could send code to run."""
    host = urlsplit(address if "//" in address else f"tcp://{address}").hostname or ""
    if not (address.startswith("tls://") or is_loopback(host)):
        raise ClusterError(
            f"{address} takes code from anybody who reaches it: start scheduler and workers with certificates "
            "(https://distributed.dask.org/en/stable/tls.html), and use tls://HOST:PORT"
        )


def replay(
    client: Client,
    reader: LogReader,
    events: Iterable[Event],
    site: Site,
    clearances_m: Sequence[float],
    *,
    on_advisory: AdvisorySink | None = None,
    on_situation: SituationSink | None = None,
    on_batch: BatchSink | None = None,
    start: StartState = StartState(),  # noqa: B008 - frozen
    window_s: float = WINDOW_S,
) -> dict[str, Any]:
    """The result of `metrics.replay.replay.replay`, computed by the workers of `client`."""
    began = time.perf_counter()
    reading = PassReader(site)
    engines: list[Any] = [(_packed(EngineRun(site, clearance_m, start)), []) for clearance_m in clearances_m]
    scoring = OutputSituations(site, len(clearances_m), start), LogScores(site, clearances_m)
    scored: Any = (_packed(scoring), WindowOutput([], []))
    in_progress: deque[Future[Any]] = deque()
    for window, is_last in _windows(events, window_s):
        passes = [*chain(reading.passes_of(window), reading.last_passes() if is_last else ())]
        if on_batch:
            for engine_pass in passes:
                on_batch(engine_pass.now_s, engine_pass.batch)
        sent: Future[Any] = client.submit(list, passes, pure=False)
        engines = [client.submit(_advance_engine, engine, sent, pure=False) for engine in engines]
        scored = client.submit(_add_to_scores, scored, sent, *engines, pure=False)
        in_progress.append(scored)
        if len(in_progress) > AHEAD:
            _write(client, in_progress.popleft(), on_advisory, on_situation)
    for scored_window in in_progress:
        _write(client, scored_window, on_advisory, on_situation)
    scores: LogScores = client.submit(_finished_scores, scored, pure=False).result()
    measures = client.submit(_measures, engines[0], pure=False).result()
    return document(scores.result(reading, measures), reader, time.perf_counter() - began)


def _windows(events: Iterable[Event], window_s: float) -> Iterator[tuple[list[Event], bool]]:
    """The events in windows, and whether each window is the last."""
    window: list[Event] = []
    until_s: float | None = None
    for event in events:
        at_s = event.arrival_s if isinstance(event, Received) else event.now_s if isinstance(event, Tick) else None
        if at_s is not None and (until_s is None or at_s >= until_s):
            if until_s is not None:
                yield window, False
                window = []
            until_s = at_s + window_s
        window.append(event)
    yield window, True


def _write(
    client: Client, scored: Future[Any], on_advisory: AdvisorySink | None, on_situation: SituationSink | None
) -> None:
    """Wait until a window is scored, then pass on what was published in it."""
    published: WindowOutput = client.submit(itemgetter(1), scored, pure=False).result()
    if on_advisory:
        for revision in published.advisories:
            on_advisory(*revision)
    if on_situation:
        for situation in published.situations:
            on_situation(situation)


def _advance_engine(
    before: tuple[State, list[EngineOutput]], passes: list[EnginePass]
) -> tuple[State, list[EngineOutput]]:
    with _unpacked(before[0]) as engine:
        outputs = [engine.advance(engine_pass) for engine_pass in passes]
        return _packed(engine), outputs


def _measures(last: tuple[State, list[EngineOutput]]) -> dict[str, Any]:
    with _unpacked(last[0]) as engine:
        return cast("EngineRun", engine).measures()


def _finished_scores(last: tuple[State, WindowOutput]) -> LogScores:
    with _unpacked(last[0]) as (_, scores):
        scores.finish()
        return cast("LogScores", scores)


def _add_to_scores(
    before: tuple[State, WindowOutput], passes: list[EnginePass], *engines: tuple[State, list[EngineOutput]]
) -> tuple[State, WindowOutput]:
    published = WindowOutput([], [])
    with _unpacked(before[0]) as (situations, scores):
        clearances_m = [each.clearance_m for each in scores.by_clearance]
        for engine_pass, *of_engines in zip(passes, *(outputs for _, outputs in engines), strict=True):
            outputs = situations.published(engine_pass.now_s, of_engines)
            scores.add(engine_pass, outputs)
            published.advisories.extend(advisory_rows(clearances_m, outputs))
            published.situations.extend(outputs[0].situations)
        return _packed((situations, scores)), published


def _packed(contents: object) -> State:
    """What a task hands on. Shapes have numbers within one process, so those of this one come first."""
    return pickle.dumps((SHAPES.numbered, contents))


@contextmanager
def _unpacked(state: State) -> Iterator[Any]:
    """What the task before has handed on, while this process numbers shapes as that one did. One task at a time."""
    with _TASK:
        shapes, contents = pickle.loads(state)  # noqa: S301 - a worker already runs any code that its scheduler sends
        SHAPES.number_as(shapes)
        yield contents
