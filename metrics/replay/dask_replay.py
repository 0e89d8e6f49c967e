"""A replay spread over a Dask cluster, with the result of a single run byte for byte.

The log is read here and cut into windows. The engine of each clearance and the judging go from window to window, each
with a state of its own, so that a window's engines run while the next is read and the one before is judged. A task
takes its state as bytes and gives it on as bytes: it changes nothing that another holds, so the scheduler may put it
anywhere and repeat it where a worker is lost.
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
from typing import Any

from dask.distributed import Client, Future, LocalCluster

from deconflict.operator.blackbox.start_state import Start
from deconflict.settings.site import Site
from ingest.recording.log_reader import Event, Reader, Received, Tick
from metrics.replay.engine_output import Said
from metrics.replay.engine_passes import Pass, Reading
from metrics.replay.replay import Line, Outcome, Run, Tell, Watch, document, streamed

WINDOW_S = 60.0
"""Of the log's time in a window: some seconds of work, so that handing states on is a few hundredths of it."""
AHEAD = 4
"""Windows under way at once, which bounds the memory."""
DASHBOARD = ":0"
"""Any port that is free: another replay may run beside this one. It is served even where nothing can be drawn on it."""

State = bytes


class ClusterError(ValueError):
    """A cluster that can't be reached, and what to change."""


@contextmanager
def cluster(address: str) -> Iterator[Client]:
    """A client of the scheduler at an address, or of a cluster of this machine's cores where that is empty."""
    logging.getLogger("distributed").setLevel(logging.ERROR)
    if address:
        try:
            client = Client(address, timeout="10s")  # type: ignore[no-untyped-call]
        except (OSError, ValueError) as error:
            raise ClusterError(f"no Dask scheduler answers at {address}: start one with `dask scheduler`") from error
        with client:
            yield client
        return
    with (
        LocalCluster(threads_per_worker=1, dashboard_address=DASHBOARD) as local,  # type: ignore[no-untyped-call]
        Client(local) as client,  # type: ignore[no-untyped-call]
    ):
        if find_spec("bokeh"):
            sys.stderr.write(f"dashboard: {client.dashboard_link}\n")
        yield client


def replay(
    client: Client,
    reader: Reader,
    events: Iterable[Event],
    site: Site,
    clearances_m: Sequence[float],
    *,
    tell: Tell | None = None,
    watch: Watch | None = None,
    start: Start = Start(),  # noqa: B008 - frozen
    window_s: float = WINDOW_S,
) -> dict[str, Any]:
    """What `metrics.replay.replay.replay` gives, worked out by the workers of `client`."""
    began = time.perf_counter()
    reading = Reading(site)
    said: list[Any] = [(pickle.dumps(Run(site, clearance_m, start)), []) for clearance_m in clearances_m]
    judged: Any = (pickle.dumps(Outcome(site, clearances_m)), [])
    under_way: deque[Future[Any]] = deque()
    for part, last in _windows(events, window_s):
        passes = [*chain(reading.take(part), reading.finish() if last else ())]
        if watch:
            for one in passes:
                watch(one.now_s, one.batch)
        given: Future[Any] = client.submit(list, passes, pure=False)
        said = [client.submit(_say, run, given, pure=False) for run in said]
        judged = client.submit(_judge, judged, given, *said, pure=False)
        under_way.append(judged)
        if len(under_way) > AHEAD:
            _tell(client, under_way.popleft(), tell)
    for window in under_way:
        _tell(client, window, tell)
    outcome: Outcome = _thawed(client.submit(itemgetter(0), judged, pure=False).result())
    measured = [client.submit(_measured, run, pure=False).result() for run in said[:1]]
    return document(outcome.result(reading, measured), reader, time.perf_counter() - began)


def _windows(events: Iterable[Event], window_s: float) -> Iterator[tuple[list[Event], bool]]:
    """The events in parts, and whether each is the last."""
    part: list[Event] = []
    until_s: float | None = None
    for event in events:
        at_s = event.arrival_s if isinstance(event, Received) else event.now_s if isinstance(event, Tick) else None
        if at_s is not None and (until_s is None or at_s >= until_s):
            if until_s is not None:
                yield part, False
                part = []
            until_s = at_s + window_s
        part.append(event)
    yield part, True


def _tell(client: Client, judged: Future[Any], tell: Tell | None) -> None:
    """Wait for a window, and tell what the stream would have said in it."""
    lines = client.submit(itemgetter(1), judged, pure=False).result()
    if tell:
        for line in lines:
            tell(line)


def _say(before: tuple[State, list[Said]], passes: list[Pass]) -> tuple[State, list[Said]]:
    run: Run = _thawed(before[0])
    said = [run.step(one) for one in passes]
    return pickle.dumps(run), said


def _measured(last: tuple[State, list[Said]]) -> dict[str, Any]:
    run: Run = _thawed(last[0])
    return run.measured()


def _judge(
    before: tuple[State, list[Line]], passes: list[Pass], *said: tuple[State, list[Said]]
) -> tuple[State, list[Line]]:
    outcome: Outcome = _thawed(before[0])
    lines: list[Line] = []
    for one, *of_each in zip(passes, *(each for _, each in said), strict=True):
        outcome.take(one, of_each)
        lines += streamed(of_each)
    return pickle.dumps(outcome), lines


def _thawed(state: State) -> Any:
    return pickle.loads(state)  # noqa: S301 - a worker runs whatever its scheduler sends, this too
