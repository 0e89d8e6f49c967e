"""The processor time to receive one message: `python -m benchmarks.receive`.

Another process sends status reports with ten path points over real sockets at a constant rate. Results are the
processor times of the receiving process for one report: for receiving alone; with the recording; and with reading, the
forecast and four batches per second as well. Overtaken statuses count as messages too. Last, the memory of one more
connection in this process.
"""

import argparse
import asyncio
import json
import resource
import socket
import struct
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from subprocess import PIPE
from uuid import UUID

from benchmarks.messages import conforming
from deconflict.settings.fleet_factory import fast_fleet_of
from deconflict.settings.site import Site
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.port.connection_limits import max_open_files
from ingest.port.receiver import Receiver
from ingest.recording.recorder import Recorder, quantise
from ingest.security.vendor_credentials import VendorCredentials
from ingest.settings import Datum, ReceiverSettings

STEP_S = 0.01
TICK_S = 0.25
WARM_S = 1.0
HANDSHAKE = (
    b"GET / HTTP/1.1\r\nHost: floor\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


@dataclass(frozen=True)
class Load:
    """A load of messages."""

    rate: int
    """Messages per second."""
    connections: int
    robots: int
    seconds: float


def template() -> bytes:
    """A frame of a client, masked with zeros, with places for the UUID and eleven timestamps."""
    report = conforming() | {"uuid": "%s", "timestamp": "%s"}
    report["path"] = [point | {"timestamp": "%s"} for point in report["path"]]
    payload = json.dumps(report)
    length = len(payload) + (36 - 2) + 11 * (24 - 2)
    return struct.pack("!BBH4x", 0x81, 0x80 | 126, length) + payload.encode()


def opened(port: int, connections: int) -> list[socket.socket]:
    sockets = []
    for _ in range(connections):
        connection = socket.create_connection(("127.0.0.1", port))
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.sendall(HANDSHAKE)
        connection.recv(4096)
        sockets.append(connection)
    return sockets


def stamps_at(now_s: float) -> list[bytes]:
    now = datetime.fromtimestamp(now_s, UTC)
    later = [now, *(now + timedelta(seconds=i) for i in range(1, 11))]
    return [moment.isoformat(timespec="milliseconds").replace("+00:00", "Z").encode() for moment in later]


def send(port: int, load: Load) -> None:
    """Send at a constant rate, each robot in turn, until the time is over."""
    max_open_files()
    frame, sockets = template(), opened(port, load.connections)
    uuids = [str(UUID(int=0xA << 76 | 0x8 << 60 | i)).encode() for i in range(load.robots)]
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    sent, began_s = 0, time.monotonic()
    while (passed_s := time.monotonic() - began_s) < WARM_S + load.seconds + 1:
        stamps = stamps_at(time.time())
        for i in range(sent, int(passed_s * load.rate)):
            sockets[i % load.connections].sendall(frame % (uuids[i % load.robots], *stamps))
            sent += 1
        time.sleep(STEP_S)


@asynccontextmanager
async def sending(port: int, load: Load) -> AsyncIterator[None]:
    """Run a sender process from when its connections are open until it has finished."""
    arguments = [str(load.rate), str(load.connections), str(load.robots), str(load.seconds)]
    command = [sys.executable, "-m", "benchmarks.receive", "--send-to", str(port), *arguments]
    sender = await asyncio.create_subprocess_exec(*command, stdout=PIPE)
    assert sender.stdout  # noqa: S101
    await sender.stdout.readline()
    yield
    await sender.wait()


async def measure(port: int, load: Load, delivered: Callable[[], int]) -> dict[str, float]:
    async with sending(port, load):
        await asyncio.sleep(WARM_S)
        count, cpu_s, at_s = delivered(), time.process_time(), time.monotonic()
        await asyncio.sleep(load.seconds)
        count, cpu_s, at_s = delivered() - count, time.process_time() - cpu_s, time.monotonic() - at_s
    if not count:
        raise SystemExit("no message arrived; see the output of the sender above")
    return {"messages_per_s": count / at_s, "us_per_message": cpu_s / count * 1e6, "core_share": cpu_s / at_s}


async def run(load: Load, *, recorded: bool, read: bool) -> dict[str, float]:
    """The figures of one receiver with the given processing of each message."""
    site, measures = Site(name="Benchmark", datums=(Datum(id=_datum(), name="Hall"),)), Measures()
    fleet, total = fast_fleet_of(site, measures), 0
    with tempfile.TemporaryDirectory() as directory:
        recorder = Recorder(site.recorder, Path(directory), measures, time.time)

        def deliver(raw: bytes, arrival_s: float, connection: Connection) -> None:
            nonlocal total
            total += 1
            rule = fleet.receive(raw, arrival_s, connection) if read else None
            if recorded:
                recorder.received(raw, arrival_s, connection, rule)

        def overtake(*_: object) -> None:
            nonlocal total
            total += 1

        async def tick() -> None:
            while True:
                await asyncio.sleep(TICK_S)
                now_s = quantise(time.time())
                recorder.tick(now_s)
                fleet.next_batch(now_s).to_bytes()

        receiver = _receiver(deliver, measures, overtake)
        await receiver.start()
        ticking = asyncio.create_task(tick())
        try:
            figures = await measure(receiver.port, load, lambda: total)
        finally:
            ticking.cancel()
            await receiver.close()
            recorder.close()
    refused = sum(measures.values["deconflict_rejections_total"].values())
    if refused or recorder.failing:
        raise SystemExit(f"{refused} messages were rejected; recording: {recorder.failing or 'in order'}")
    return figures


async def connection_bytes(connections: int) -> float:
    """Resident memory of the receiving side of one open connection. The client is another process."""
    receiver = _receiver(lambda *_: None, Measures(), lambda *_: None)
    await receiver.start()
    before = _resident()
    load = Load(rate=1, connections=connections, robots=1, seconds=1.0)
    async with sending(receiver.port, load):
        after = _resident()
    await receiver.close()
    return (after - before) / connections


def _receiver(
    deliver: Callable[[bytes, float, Connection], None], measures: Measures, overtaken: Callable[..., None]
) -> Receiver:
    def ignore(*_: object) -> None:
        pass

    def now_s() -> float:
        return quantise(time.time())

    return Receiver(
        ReceiverSettings(port=0),
        VendorCredentials(()),
        deliver,
        ignore,
        ignore,
        overtaken=overtaken,
        measures=measures,
        clock=now_s,
    )


def _datum() -> str:
    return str(conforming()["location"]["planarDatum"])


def _resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rate", type=int, default=10_000)
    parser.add_argument("--connections", type=int, default=20)
    parser.add_argument("--robots", type=int, default=10_000)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--send-to", nargs=5, metavar=("PORT", "RATE", "CONNECTIONS", "ROBOTS", "SECONDS"))
    args = parser.parse_args()
    if args.send_to:
        port, rate, connections, robots, seconds = args.send_to
        send(int(port), Load(int(rate), int(connections), int(robots), float(seconds)))
        return
    load = Load(args.rate, args.connections, args.robots, args.seconds)
    print(f"{load.rate} messages per second over {load.connections} connections from {load.robots} robots")
    print(f"{'':<36}{'messages/s':>12}{'us/message':>12}{'of a core':>11}")
    results: dict[str, dict[str, float]] = {}
    for name, recorded, read in (
        ("received", False, False),
        ("and recorded", True, False),
        ("and read, forecast, cut in batches", True, True),
    ):
        results[name] = figures = asyncio.run(run(load, recorded=recorded, read=read))
        rate, us, share = figures["messages_per_s"], figures["us_per_message"], figures["core_share"]
        print(f"{name:<36}{rate:>12.0f}{us:>12.1f}{share:>11.0%}")
    per_connection = asyncio.run(connection_bytes(2000))
    print(f"memory of an open connection: {per_connection / 1024:.1f} KiB")
    print(json.dumps({"load": vars(load), "results": results, "connection_bytes": per_connection}))


if __name__ == "__main__":
    main()
