"""The whole service under load: `python -m benchmarks.endtoend [--robots 100 1000] [--seconds 60] [--json OUT]`.

The service runs as with `deconflict serve`: one process for each role, with everything switched on. The load comes from
its own process over real sockets, or with `--language` from a broker (mosquitto). On a machine with two cores, they all
share these.
"""

import argparse
import json
import math
import multiprocessing
import os
import socket
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from benchmarks import broker_offer, offer
from deconflict.roles.processes.supervisor import Supervisor
from deconflict.roles.service import runtime_directory
from deconflict.runtime.rpc import Caller, LinkDownError
from deconflict.settings.site import DEFAULT, Site
from ingest.measures.measures import Histogram
from ingest.settings import Datum, Vendor

LATENCY = "deconflict_message_to_advisory_seconds"
LATE_S = 1.0
PREPARED_WITHIN_S = 300.0
WEBSOCKETS, MIXED = "massrobotics", "mixed"
"""The language of robots that are not at a broker; and as many robots of each language."""


@dataclass(frozen=True)
class Usage:
    """The resources that one role has used so far."""

    core_s: float
    memory_mb: float
    files: int


@dataclass(frozen=True)
class Row:
    """The figures of one run or of a part of it."""

    robots: int
    seconds: float
    messages_a_second: float
    accepted: float
    rejected: float
    overtaken: float
    """Statuses that the receiver did not read because a newer one had arrived."""
    superseded: float
    """Statuses that a newer one replaced before the engine read them, including overtaken ones."""
    shed: float
    """Messages dropped because their vendor exceeded its rate limit."""
    missed: float
    """Passes of the engine that missed their deadline."""
    late: float
    """Messages that took more than `LATE_S` until the advisories reflected them."""
    p50_ms: float
    p99_ms: float
    slowest_ms: float
    """Upper bound of the slowest message's bucket."""
    core_s_a_second: dict[str, float]
    memory_mb: dict[str, float]
    files: dict[str, int]
    advisories: float


class Running:
    """A running service that is measured."""

    def __init__(self, supervisor: Supervisor, runtime: Path, data: Path, robots_port: int, operator_port: int) -> None:
        self.roles, self.fork_server = supervisor.roles, supervisor.fork_server
        self._caller = Caller(runtime, "operator")
        self.data, self.url, self.face = data, f"ws://127.0.0.1:{robots_port}", f"127.0.0.1:{operator_port}"
        self._at_s, self._before, self._used = time.monotonic(), self.measures(), self.usage()

    def close(self) -> None:
        self._caller.close()

    def measures(self) -> dict[str, Any]:
        """Of all roles: sums by metric name, counts by metric and second label, and the latency histogram."""
        sums: dict[str, Any] = {}
        rows: list[Any] = []
        for document in self.documents():
            for name, series in document["values"].items():
                for labels, value in series:
                    for key in (name, f"{name} {labels[1]}" if len(labels) > 1 else None):
                        if key:
                            sums[key] = sums.get(key, 0.0) + value
            rows += document["histograms"].get(LATENCY, [])
        sums["latency"] = Histogram.joined(rows) if rows else Histogram()
        return sums

    def usage(self) -> dict[str, Usage]:
        """Of each role, and of the fork server, which holds the code that they share."""
        return {process.role: usage(process.pid) for process in (*self.roles, self.fork_server) if process.pid}

    def row(self, robots: int) -> Row:
        """The figures since the last row."""
        now_s, after, used = time.monotonic(), self.measures(), self.usage()
        seconds, before = now_s - self._at_s, self._before
        waits = since(before["latency"], after["latency"])
        accepted = _rise(before, after, "deconflict_messages_total accepted")
        row = Row(
            robots=robots,
            seconds=round(seconds, 1),
            messages_a_second=round(accepted / seconds, 1),
            accepted=accepted,
            rejected=_rise(before, after, "deconflict_messages_total rejected"),
            overtaken=_rise(before, after, "deconflict_messages_total overtaken"),
            superseded=_rise(before, after, "deconflict_statuses_superseded_total"),
            shed=_rise(before, after, "deconflict_messages_shed_total"),
            missed=_rise(before, after, "deconflict_deadlines_missed_total"),
            late=sum(count for bound, count in _by_bound(waits) if bound > LATE_S),
            p50_ms=round(waits.quantile(0.5) * 1000, 1),
            p99_ms=round(waits.quantile(0.99) * 1000, 1),
            slowest_ms=_slowest_s(waits) * 1000,
            core_s_a_second={
                role: round((usage.core_s - self._used[role].core_s) / seconds, 3) for role, usage in used.items()
            },
            memory_mb={role: round(usage.memory_mb, 1) for role, usage in used.items()},
            files={role: usage.files for role, usage in used.items()},
            advisories=_rise(before, after, "deconflict_advisories_stored_total"),
        )
        self._at_s, self._before, self._used = now_s, after, used
        return row

    def documents(self) -> list[dict[str, Any]]:
        """The measures of each role."""
        until_s = time.monotonic() + 30
        while True:
            try:
                answer: list[dict[str, Any]] = json.loads(self._caller.call("measures"))
            except LinkDownError:
                if time.monotonic() > until_s:
                    raise
                time.sleep(0.1)
            else:
                return answer


@contextmanager
def service(
    docks_for: int = 0, data_directory: Path | None = None, changes: dict[str, Any] | None = None
) -> Iterator[Running]:
    """Run the service on a floor with docks for `docks_for` robots, one process for each role, until the block ends.

    `changes` replaces sections of the site.
    """
    stop, (robots_port, operator_port) = threading.Event(), free_ports(2)
    with tempfile.TemporaryDirectory(prefix="benchmark-") as own, runtime_directory() as runtime:
        data = data_directory or own
        site = benchmark_site(robots_port, operator_port, docks_for).model_copy(update=changes or {})
        supervisor = Supervisor(site, Path(data), Path(runtime))
        running = threading.Thread(target=supervisor.run, args=(stop,))
        running.start()
        try:
            _wait_for_processes(supervisor)
            measured_service = Running(supervisor, Path(runtime), Path(data), robots_port, operator_port)
            _wait_for(robots_port)
            yield measured_service
            measured_service.close()
        finally:
            stop.set()
            running.join()


class Load:
    """The load, in its own process."""

    def __init__(self, url: str, robots: int, seconds: float, core: int | None = None, *, docks: bool = False) -> None:
        spawn = multiprocessing.get_context("spawn")
        self._pipe, child = spawn.Pipe()
        arguments = (child, url, robots, seconds, core)
        self._process = spawn.Process(target=offer.serve, args=arguments, kwargs={"docks": docks})
        self._process.start()
        child.close()

    def result(self) -> dict[str, float]:
        """Wait for its end. Returns what it did."""
        result: dict[str, float] = self._pipe.recv()
        self._process.join()
        return result

    def stop(self) -> dict[str, float]:
        self._pipe.send("stop")
        return self.result()


def measured(
    robots: int,
    seconds: float,
    settle_s: float = 10.0,
    load_core: int | None = None,
    *,
    docks: bool = False,
    language: str = WEBSOCKETS,
) -> tuple[Row, dict[str, float]]:
    """The figures of a run after `settle_s`, and the figures of the load over WebSockets, if there is one."""
    languages = [WEBSOCKETS, *broker_offer.LANGUAGES] if language == MIXED else [language]
    at_broker = [name for name in languages if name != WEBSOCKETS]
    at_sockets = robots // len(languages) if WEBSOCKETS in languages else 0
    changes = {"mqtt_sources": broker_offer.sources(at_broker)}
    with (
        broker_offer.broker() if at_broker else nullcontext(),
        service(robots if docks else 0, None, changes) as running,
    ):
        load = Load(running.url, at_sockets, settle_s + seconds, load_core, docks=docks) if at_sockets else None
        others = broker_offer.start(robots - at_sockets, settle_s + seconds, at_broker) if at_broker else None
        time.sleep(settle_s)
        running.row(robots)
        time.sleep(seconds - 1)
        row = running.row(robots)
        if others:
            others.join()
        return row, load.result() if load else {}


def print_row(row: Row, load: dict[str, float] | None = None) -> None:
    each = max(row.accepted + row.overtaken + row.rejected, 1.0)
    cores = " ".join(
        f"{role} {share:.2f} ({share * row.seconds / each * 1e6:.0f} us a message)"
        for role, share in row.core_s_a_second.items()
    )
    memory = sum(row.memory_mb.values())
    late = f"  load late {load['late_s'] * 1000:.0f} ms cores {load['core_s'] / load['seconds']:.2f}" if load else ""
    print(
        f"{row.robots:6} robots {row.messages_a_second:6.0f} msg/s p50 {row.p50_ms:5.0f} ms  p99 {row.p99_ms:5.0f} ms  "
        f"slowest < {row.slowest_ms:6.0f} ms  overtaken {row.overtaken:5.0f}  superseded {row.superseded:5.0f}  "
        f"shed {row.shed:3.0f}  rejected {row.rejected:3.0f}  "
        f"cores {cores}  {memory:5.0f} MB  files {sum(row.files.values())}{late}",
        flush=True,
    )


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--robots", type=int, nargs="+", default=[100, 1000, 3000, 10000])
    arguments.add_argument("--seconds", type=float, default=60.0)
    arguments.add_argument("--load-core", type=int, help="pin the load to this core")
    arguments.add_argument("--docks", action="store_true", help="add a dock and a crossing for every ten robots")
    choices = [WEBSOCKETS, *broker_offer.LANGUAGES, MIXED]
    arguments.add_argument("--language", choices=choices, default=WEBSOCKETS, help="what the robots speak")
    arguments.add_argument("--json", type=Path)
    args = arguments.parse_args()
    runs = []
    for robots in args.robots:
        row, load = measured(robots, args.seconds, load_core=args.load_core, docks=args.docks, language=args.language)
        print_row(row, load)
        runs.append(asdict(row) | {"load": load})
    if len(runs) > 1:
        print(f"growth exponent of core seconds: {_exponent(runs):.2f}")
    if args.json:
        args.json.write_text(json.dumps(runs, indent=2) + "\n")


def _exponent(runs: list[dict[str, Any]]) -> float:
    first, last = runs[0], runs[-1]
    cores = [sum(run["core_s_a_second"].values()) for run in (first, last)]
    return math.log(cores[1] / cores[0]) / math.log(last["robots"] / first["robots"])


def benchmark_site(robots_port: int, operator_port: int, docks_for: int = 0) -> Site:
    """A hall with docks and crossings for `docks_for` robots."""
    docks, crossings = offer.places(docks_for)
    return DEFAULT.model_copy(
        update={
            "datums": (Datum(id=offer.DATUM, name="Hall"),),
            "vendors": tuple(Vendor(name=name) for name in offer.VENDORS),
            "resources": docks,
            "zones": crossings,
            "receiver": DEFAULT.receiver.model_copy(update={"port": robots_port}),
            "operator": DEFAULT.operator.model_copy(update={"port": operator_port}),
        }
    )


def free_ports(count: int) -> list[int]:
    """Ports of this machine on which nobody listens."""
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [int(each.getsockname()[1]) for each in sockets]
    for each in sockets:
        each.close()
    return ports


def _wait_for_processes(supervisor: Supervisor) -> None:
    """Wait until each role has a process. The engine has none while its kernels are compiled."""
    until_s = time.monotonic() + PREPARED_WITHIN_S
    while not all(role.pid for role in supervisor.roles):
        if time.monotonic() > until_s:
            raise TimeoutError("the roles do not start; run `deconflict prepare` first")
        time.sleep(0.05)


def _wait_for(port: int) -> None:
    until_s = time.monotonic() + 30
    while True:
        try:
            socket.create_connection(("127.0.0.1", port), timeout=1).close()
        except OSError:
            if time.monotonic() > until_s:
                raise
            time.sleep(0.05)
        else:
            return


def usage(pid: int) -> Usage:
    """Processor time, memory and open files from /proc (Linux). What processes share is divided among them."""
    of = Path("/proc") / str(pid)
    ticks = (of / "stat").read_text().rsplit(")", 1)[1].split()
    memory_kb = int((of / "smaps_rollup").read_text().split("Pss:")[1].split()[0])
    return Usage(
        core_s=(int(ticks[11]) + int(ticks[12])) / os.sysconf("SC_CLK_TCK"),
        memory_mb=memory_kb * 1024 / 1e6,
        files=len(list((of / "fd").iterdir())),
    )


def _rise(before: dict[str, Any], after: dict[str, Any], name: str) -> float:
    return float(after.get(name, 0.0) - before.get(name, 0.0))


def since(before: Histogram, after: Histogram) -> Histogram:
    """What was observed between two looks; all of it if the role has begun anew in between."""
    if any(b > a for a, b in zip(after.counts, before.counts, strict=True)):
        return after
    between = Histogram(after.bounds)
    between.counts = [b - a for a, b in zip(before.counts, after.counts, strict=True)]
    between.total = after.total - before.total
    return between


def _slowest_s(waits: Histogram) -> float:
    return max((bound for bound, count in _by_bound(waits) if count), default=0.0)


def _by_bound(waits: Histogram) -> list[tuple[float, int]]:
    """Upper bound and count of each bucket."""
    return list(zip((*waits.bounds, math.inf), waits.counts, strict=True))


if __name__ == "__main__":
    main()
