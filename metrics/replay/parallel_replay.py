"""A replay in several processes, with the bytes of a replay in one.

This process reads the log, and passes on what is published. The engine of each clearance has a process, and so have the
scores. Passes travel in groups, engines to scores too; while one group is scored, the engines run the next one, and
this process reads ahead. Each part sees the same data in the same order as in one process.

The processes are forks, made before the log is read: they share the memory of the code, and need not load it again.
"""

import os
import pickle
import signal
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.context import ForkProcess
from queue import Empty, Queue
from threading import Thread
from typing import Any, NamedTuple

from deconflict.advisories.situations.situation import Situation
from deconflict.advisory import AnyAdvisory
from deconflict.operator.blackbox.start_state import StartState
from deconflict.settings.site import Site
from ingest.recording.log_reader import Event, LogReader
from metrics.replay.engine_run import EngineRun
from metrics.replay.log_scores import LogScores
from metrics.replay.output_situations import OutputSituations
from metrics.replay.recorded_passes import EnginePass, PassReader
from metrics.replay.replay import AdvisorySink, BatchSink, SituationSink, advisory_rows, document

GROUP_PASSES, GROUP_ROBOTS = 40, 2_000
"""A group ends with this many passes, or with this many robots in its batches."""
AHEAD = 4
"""Groups that wait at a process. Bounds the memory."""
OTHER_ENDED = 3
"""Exit code of a process that ends because another one did."""
FORK = get_context("fork")


class ReplayProcessError(RuntimeError):
    """A process of the replay ended too early. The message says which, and what to change."""


class PublishedPass(NamedTuple):
    """What the live stream would have published at one pass."""

    advisories: list[tuple[float, AnyAdvisory]]
    """Each with the clearance of its engine."""
    situations: Sequence[Situation]
    """Those of the first clearance."""


class Inbox:
    """Receives from another process beside the work of this one, at most `most` messages ahead; 0 is any number."""

    def __init__(self, connection: Connection, most: int = AHEAD) -> None:
        self._connection, self._messages = connection, Queue[bytes | None](most)
        Thread(target=self._receive, daemon=True).start()

    def get(self, *, wait: bool = True) -> Any:
        """The next message. Raises `EOFError` if the sender has ended, and `Empty` if there is none to wait for."""
        message = self._messages.get(block=wait)
        if message is None:
            raise EOFError
        return pickle.loads(message)  # noqa: S301 - from a process of this replay

    def _receive(self) -> None:
        try:
            while True:
                self._messages.put(self._connection.recv_bytes())
        except (EOFError, OSError):
            self._messages.put(None)


class _Processes:
    """The processes of one replay, and the connections between them and this one."""

    def __init__(self, site: Site, clearances_m: Sequence[float], start: StartState) -> None:
        self._connections: list[Connection] = []
        self._started: dict[str, ForkProcess] = {}
        to_engines, outputs = [self._pipe() for _ in clearances_m], [self._pipe() for _ in clearances_m]
        to_scores, published = self._pipe(), self._pipe()
        for clearance_m, (passes, _), (_, output) in zip(clearances_m, to_engines, outputs, strict=True):
            self._start(f"engine at {clearance_m:g} m", _run_engine, (passes, output), (site, clearance_m, start))
        ends = (to_scores[0], published[1], *(receiving for receiving, _ in outputs))
        self._start("scoring", _score, ends, (site, clearances_m, start))
        self._receivers = [sending for _, sending in (*to_engines, to_scores)]
        for connection in self._connections:
            if connection not in (*self._receivers, published[0]):
                connection.close()
        self._inbox = Inbox(published[0], most=0)

    def send(self, passes: list[EnginePass]) -> None:
        """Send a group of passes to all. Raises `ReplayProcessError`."""
        data = _pickled(passes)
        try:
            for receiver in self._receivers:
                receiver.send_bytes(data)
        except OSError as error:
            raise self._error() from error

    def received(self, *, wait: bool) -> Any:
        """What the scores sent; None if there is nothing yet. Raises `ReplayProcessError`."""
        try:
            return self._inbox.get(wait=wait)
        except Empty:
            return None
        except EOFError as error:
            raise self._error() from error

    def end(self) -> None:
        """End all processes, whatever they do."""
        for process in self._started.values():
            process.kill()
            process.join()
        for connection in self._receivers:
            connection.close()

    def _pipe(self) -> tuple[Connection, Connection]:
        """The receiving and the sending end of a pipe."""
        receiving, sending = FORK.Pipe(duplex=False)
        self._connections += receiving, sending
        return receiving, sending

    def _start(
        self, name: str, run: Callable[..., None], ends: Sequence[Connection], arguments: Sequence[object]
    ) -> None:
        process = FORK.Process(
            target=_run, args=(run, ends, [*self._connections], arguments), name=f"replay: {name}", daemon=True
        )
        process.start()
        self._started[name] = process

    def _error(self) -> ReplayProcessError:
        """Why the processes do not answer any more."""
        for process in self._started.values():
            process.join(5)
        codes = {name: process.exitcode for name, process in self._started.items()}
        name, code = next(
            ((name, code) for name, code in codes.items() if code not in (None, 0, OTHER_ENDED)), ("scoring", None)
        )
        how = f"by {signal.Signals(-code).name}" if code and code < 0 else "with an error"
        return ReplayProcessError(
            f"the process of the replay for {name} was ended {how}, so there is no result; "
            "--jobs 1 needs less memory, and one process only"
        )


def replay(
    reader: LogReader,
    events: Iterable[Event],
    site: Site,
    clearances_m: Sequence[float],
    *,
    on_advisory: AdvisorySink | None = None,
    on_situation: SituationSink | None = None,
    on_batch: BatchSink | None = None,
    start: StartState = StartState(),  # noqa: B008 - frozen
) -> dict[str, Any]:
    """The result of `metrics.replay.replay.replay`. Raises `ReplayProcessError`."""
    began, passes, unpublished = time.perf_counter(), PassReader(site), deque[EnginePass]()

    def publish(group: Sequence[PublishedPass]) -> None:
        for published in group:
            engine_pass = unpublished.popleft()
            if on_batch:
                on_batch(engine_pass.now_s, engine_pass.batch)
            if on_advisory:
                for revision in published.advisories:
                    on_advisory(*revision)
            if on_situation:
                for situation in published.situations:
                    on_situation(situation)

    processes = _Processes(site, clearances_m, start)
    try:
        for group in _groups(chain(passes.passes_of(events), passes.last_passes())):
            unpublished.extend(group)
            processes.send(group)
            while (published := processes.received(wait=False)) is not None:
                publish(published)
        processes.send([])
        while unpublished:
            publish(processes.received(wait=True))
        scores, measures = processes.received(wait=True)
    finally:
        processes.end()
    return document(scores.result(passes, measures), reader, time.perf_counter() - began)


def _groups(passes: Iterable[EnginePass]) -> Iterator[list[EnginePass]]:
    group, robots = list[EnginePass](), 0
    for engine_pass in passes:
        group.append(engine_pass)
        robots += len(engine_pass.batch)
        if len(group) == GROUP_PASSES or robots >= GROUP_ROBOTS:
            yield group
            group, robots = [], 0
    if group:
        yield group


def _pickled(message: object) -> bytes:
    return pickle.dumps(message, pickle.HIGHEST_PROTOCOL)


def _run(
    run: Callable[..., None],
    ends: Sequence[Connection],
    connections: Sequence[Connection],
    arguments: Sequence[object],
) -> None:
    """Run a process that uses the `ends` of some `connections`. The others are closed, so that all see its end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # this process is interrupted, and ends the others
    for connection in connections:
        if connection not in ends:
            connection.close()
    try:
        run(*ends, *arguments)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        os._exit(OTHER_ENDED)


def _run_engine(passes: Connection, outputs: Connection, site: Site, clearance_m: float, start: StartState) -> None:
    """Run an engine over the groups of passes, the last of which is empty. Sends the output of each."""
    engine, inbox = EngineRun(site, clearance_m, start), Inbox(passes)
    while group := inbox.get():
        outputs.send_bytes(_pickled([engine.advance(engine_pass) for engine_pass in group]))
    outputs.send_bytes(_pickled(engine.measures()))


def _score(passes: Connection, published: Connection, *engines_and_settings: Any) -> None:
    """Score the outputs of all engines, and send what is published; at the end the scores, and the first one's
    measures. `engines_and_settings` are the connections of the engines, the site, the clearances and the start."""
    *engines, site, clearances_m, start = engines_and_settings
    situations, scores = OutputSituations(site, len(engines), start), LogScores(site, clearances_m)
    inbox, engine_inboxes = Inbox(passes), [Inbox(engine) for engine in engines]
    while group := inbox.get():
        of_group = []
        for engine_pass, *of_engines in zip(group, *(each.get() for each in engine_inboxes), strict=True):
            outputs = situations.published(engine_pass.now_s, of_engines)
            scores.add(engine_pass, outputs)
            of_group.append(PublishedPass([*advisory_rows(clearances_m, outputs)], outputs[0].situations))
        published.send_bytes(_pickled(of_group))
    scores.finish()
    published.send_bytes(_pickled((scores, engine_inboxes[0].get())))
