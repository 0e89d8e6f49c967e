"""A floor that is recorded and decided upon as the service does it, at the speed of the processor."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from math import pi, sin
from pathlib import Path

from deconflict.engine.engine import Engine
from deconflict.operator.blackbox.archive import FOLDER, Archive, Box
from deconflict.operator.blackbox.blackbox_request import BlackBoxRequest, BoxSpan, LearnedSnapshot, NearPair
from deconflict.operator.store.store import Store
from deconflict.runtime.learned_state import packed
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import BlackBox, Site
from deconflict_client.advisory import AnyAdvisory
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.recording.recorder import Recorder, quantise
from ingest.settings import Datum, RecorderSettings, Vendor
from tests.helpers.saying import HALL, identity, points, status

NOW_S = 1_790_000_000.0
TICK_S = 0.25
SITE = Site(
    datums=(Datum(id=HALL, name="Hall"),),
    vendors=(Vendor(name="Alder", token="env:ALDER_TOKEN", dial=("ws://10.0.0.1:9000",)),),
    blackbox=BlackBox(before_s=20.0, after_s=15.0),
)

Course = Callable[[float], tuple[float, float, float]]
"""Seconds since the start to x, y and heading."""


def crossing(met_s: float, behind_m: float) -> dict[str, Course]:
    """Two that cross at right angles, the second so far behind the first, and one that goes its own way."""
    return {
        "A-1": lambda t: (t - met_s, 0.0, 0.0),
        "B-1": lambda t: (0.0, t - met_s - behind_m, pi / 2),
        "C-1": lambda t: (0.7 * t, 30.0, 0.0),
    }


@dataclass
class Floor:
    """What happened, and what was told of it."""

    data: Path
    near: list[NearPair] = field(default_factory=list)
    decided: list[AnyAdvisory] = field(default_factory=list)
    snapshots: list[LearnedSnapshot] = field(default_factory=list)

    def order(self) -> BlackBoxRequest:
        settings = SITE.blackbox
        begins_s = min(near_pair.at_s for near_pair in self.near) - settings.before_s - 15.0
        snapshot = next((snapshot for snapshot in reversed(self.snapshots) if snapshot.at_s <= begins_s), None)
        span = BoxSpan.around(self.near, settings.before_s, settings.after_s, snapshot)
        advisories = [advisory for advisory in self.decided if advisory.updated_at.timestamp() <= span.until_s]
        shelf = self.data / FOLDER
        shelf.mkdir(exist_ok=True)
        with closing(Store(self.data)) as store:
            store.append(advisories)
        return BlackBoxRequest(SITE, self.data / "log", shelf, tuple(self.near), span, snapshot, store.path, ())


def lived(
    data: Path,
    courses: dict[str, Course],
    seconds: int,
    sways_s: float = 0.0,
    settings: RecorderSettings = SITE.recorder,
) -> Floor:
    """Robots that report once a second; every engine step, recorded.

    Until `sways_s` they sway, of which their paths say nothing.
    """
    now_s = NOW_S
    recorder = Recorder(settings, data / "log", Measures(), lambda: now_s)
    fleet, engine, floor = fleet_of(SITE, Measures()), Engine(SITE), Floor(data)
    connection = Connection(1, "127.0.0.1", vendor="Alder")

    def say(raw: bytes, at_s: float) -> None:
        fleet.receive(raw, at_s, connection)
        recorder.received(raw, at_s, connection, None)

    for name in courses:
        say(identity(name, NOW_S), NOW_S)
    for tick in range(1, int(seconds / TICK_S)):
        now_s = quantise(NOW_S + tick * TICK_S)
        if tick % 4 == 1:
            for name, course in courses.items():
                t = now_s - NOW_S
                path = points(*((now_s + i, *course(t + i)) for i in range(1, 11)))
                x, y, yaw = course(t)
                sway_m = 0.5 * (t < sways_s)
                say(status(name, now_s, x + sway_m * sin(2 * t), y + sway_m * sin(1.3 * t), yaw, path=path), now_s)
        recorder.tick(now_s)
        engine.receive(fleet.next_batch(now_s))
        floor.decided += engine.step(now_s)
        floor.near += [NearPair(*pair, now_s) for pair in engine.near_misses]
        if tick % 80 == 0:
            floor.snapshots.append(LearnedSnapshot(now_s, packed(engine.learned()), {}))
    recorder.close()
    return floor


def put(shelf: Archive, number: int, size: int = 100, year: int = 2026, *pairs: str) -> Box:
    """With a near miss of each pair of vendors, a letter each."""
    name = f"blackbox-{year}092{number}T141500000Z.jsonl.zst"
    (shelf.directory / name).write_bytes(b"x" * size)
    until = f"{year}-09-2{number}T14:15:00.000000Z"
    near = [{"vendors": list(pair)} for pair in pairs]
    box = {"file": name, "bytes": size, "sha256": f"{number}" * 64, "until": until, "near_misses": near}
    shelf.add(box)
    return box
