import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import cos, pi, sin
from random import Random
from types import FrameType
from typing import Any

import pytest

from ingest.fast_path.status_scanner import ScannedStatus
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.repeat_status import RepeatReader, load
from ingest.fleet.shown.odd_values import Oddities
from ingest.fleet.shown.quarantine import Quarantine
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Datum, Model, Reading, Vendor
from tests.helpers.saying import HALL, LOFT, angle, identity, points, robot, stamp, status
from tests.ingest.fleet.made_fleet import documents
from tests.ingest.frames.made_maps import HALL as PLACES
from tests.ingest.frames.made_maps import similarity

NOW_S = 1_790_000_000.0
OWN = "0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1b0f"
LINES = Connection(1), Connection(2), Connection(3, vendor="Alder")
MARKS = [f"mark-{row}" for row in range(len(PLACES))]
Sent = tuple[bytes, float, Connection]
HORIZONS_S = 7.3, 10.0, 30.0
LONGEST_S = HORIZONS_S[-1] + 34.4
"""The longest horizon, and the longest time between two statuses."""
LATE_ROBOTS, LATE_ROUNDS = 10, 40
COMPARED_S = 5.5
"""Headings and motion of statuses further apart than this contradict nothing, whatever the clock's correction."""


def fleet(*, fast: bool = True, reading: Reading | None = None) -> Fleet:
    marks = [{"id": name, "x": x, "y": y} for name, (x, y) in zip(MARKS, PLACES.tolist(), strict=True)]
    hall = Datum.model_validate({"id": HALL, "name": "Hall", "reference_points": marks})
    own = similarity(0.4, 1.0, (3.0, -2.0), mirrored=True)(PLACES).tolist()
    readings = {name: tuple(at) for name, at in zip(MARKS, own, strict=True)}
    mapped = {"datum": OWN, "site_datum": HALL, "readings": readings, "mirrored": True}
    loads = Model(offset_m=(0.2, 0.1), loaded_envelope_m=(1.5, 1.0, 2.0))
    vendors = Vendor.model_validate({"name": "Alder", "maps": [mapped], "models": {"A1": loads}}), Vendor(name="Basalt")
    made = Fleet(
        VendorRegistry(vendors),
        FrameRegistry((hall, Datum(id=LOFT, name="Loft")), vendors),
        reading or Reading(),
        Measures(),
        Quarantine(),
    )
    if fast:
        made.use(load())
    return made


@dataclass
class Driver:
    """A robot that mostly repeats its last status but for its motion."""

    name: str
    random: Random
    x: float = 5.0
    y: float = 5.0
    yaw_rad: float = 0.0
    state: str = "navigating"
    datum: str = HALL
    ahead_s: float = 0.0
    line: Connection = LINES[0]
    stops: int = 2
    tells_path: bool = True
    more: dict[str, Any] = field(default_factory=dict)

    def seldom(self, share: float = 0.02) -> bool:
        return self.random.random() < share

    def drive(self, t_s: float, after_s: float) -> bytes:
        random, speed_mps = self.random, self.random.choice((1.0, 1.0, 1.0, 0.0, -0.5))
        turn_rad = random.choice((0.0, 0.0, 0.3, -0.2)) * after_s
        self.yaw_rad = (self.yaw_rad + turn_rad + pi) % (2 * pi) - pi
        way_m = speed_mps * after_s
        self.x, self.y = self.x + way_m * cos(self.yaw_rad), self.y + way_m * sin(self.yaw_rad)
        if self.seldom():
            self.x, self.y = random.uniform(0, 40), random.uniform(0, 25)
        if self.seldom(0.05):
            self.state = random.choice(("navigating", "navigating", "idle", "charging", "waiting", "manualOverride"))
        if self.seldom():
            self.datum = random.choice((HALL, LOFT, OWN, OWN.upper(), "yard"))
        if self.seldom(0.01):
            self.ahead_s = random.choice((0.0, 3.0, -40.0))
        if self.seldom():
            self.line = random.choice(LINES)
        if self.seldom(0.05):
            self.stops, self.tells_path = random.choice((0, 0, 1, 2, 3)), random.random() < 0.6
        if self.seldom(0.05):
            self.more = {"loadPercentageStillAvailable": random.choice((None, 30.0, 100.0))}
        return self.said(t_s + self.ahead_s, speed_mps, turn_rad / after_s)

    def said(self, stamp_s: float, speed_mps: float, turn_radps: float) -> bytes:
        random = self.random
        document: dict[str, Any] = {"operationalState": self.state, **self.more}
        document |= {
            "batteryPercentage": random.choice((None, 50, 49.5)),
            "remainingRunTime": random.choice((None, 2.5)),
        }
        velocity: dict[str, Any] = {"linear": abs(speed_mps) if self.seldom(0.1) else speed_mps}
        if not self.seldom(0.1):
            velocity["angular"] = angle(turn_radps if not self.seldom() else 2.5)
        if not self.seldom():
            document["velocity"] = velocity
        here = {"x": self.x, "y": self.y, "z": random.choice((0.0, 0.2)), "planarDatum": self.datum}
        if not self.seldom():
            here["angle"] = angle(self.yaw_rad)
        if (self.state == "navigating" and self.tells_path) or self.seldom():
            document["path"] = self.points_ahead(
                stamp_s, random.choice((5, 10, 10, 12)), random.choice((1.0, 1.0, 3.0))
            )
        if self.stops:
            document["destinations"] = self.points_ahead(stamp_s, self.stops, random.choice((20.0, 20.0, 700.0, -2.0)))
        if self.seldom():
            document["errorCodes"] = [random.choice(("localisation lost", "E7"))]
        return status(self.name, stamp_s, timestamp=stamp(stamp_s), location=here, **document)

    def points_ahead(self, stamp_s: float, count: int, every_s: float) -> list[dict[str, Any]]:
        first_s = stamp_s if not self.seldom() else stamp_s - 5 * abs(every_s)
        times = sorted(first_s + every_s * i for i in range(1, count + 1))
        x, y, step_m = self.x, self.y, min(abs(every_s), 3.0) if not self.seldom() else 60.0
        ways = [(t_s, x + step_m * i, y + 0.1 * i, self.yaw_rad) for i, t_s in enumerate(times, 1)]
        answers = points(*ways)
        if self.seldom(0.05):
            answers = [document | {"planarDatumUUID": self.random.choice((HALL, LOFT))} for document in answers]
        return answers


def sent(seed: int, messages: int) -> Iterator[Sent]:
    random, t_s = Random(seed), NOW_S
    drivers = [Driver(f"R-{i}", random, line=LINES[i % 3]) for i in range(6)]
    for driver in drivers[1:]:
        yield identity(driver.name, t_s, manufacturerName=random.choice(("Alder", "Basalt"))), t_s, driver.line
    for _ in range(messages):
        after_s = random.choice((1.0, 1.0, 1.0, 1.0, 1.0, 3.0, 4.0, 0.4, 7.0, 40.0))
        t_s += after_s
        for driver in drivers:
            late_s = random.choice((0.05, 0.05, 0.05, 0.3, 1.5))
            yield driver.drive(t_s, after_s), t_s + late_s, driver.line
            if driver.seldom(0.01):
                yield identity(driver.name, t_s, robotModel=random.choice(("A1", "A2"))), t_s + late_s, driver.line


@dataclass
class LateDriver:
    """A robot whose statuses come 2 to 35 s apart, and differ only in motion."""

    name: str
    random: Random
    x: float = 5.0
    y: float = 5.0
    yaw_rad: float = 0.0

    def __post_init__(self) -> None:
        random = self.random
        self.does, self.datum = random.choice(("path", "velocity", "velocity", "charging")), random.choice((HALL, OWN))
        self.turns = random.choice((-1.0, 0.0, 1.0)) * (self.does != "charging")
        self.size_m = {axis: random.uniform(0.3, 3.0) for axis in "xyz"}

    def drive(self, t_s: float, after_s: float) -> bytes:
        random, speed_mps = self.random, self.random.choice((-1.0, 1.0)) * self.random.uniform(0.2, 1.5)
        if self.does == "charging":
            speed_mps = 0.0
        if after_s < COMPARED_S:
            turn_radps = self.turns * random.uniform(0.0, 0.25)
            self.yaw_rad += turn_radps * after_s
            way_m, way_rad = speed_mps * after_s, self.yaw_rad - turn_radps * after_s / 2
        else:
            turn_radps, self.yaw_rad = self.turns * random.uniform(0.0, 1.9), random.uniform(-pi, pi)
            way_m, way_rad = random.uniform(0.0, 1.5) * after_s, random.uniform(-pi, pi)
        if self.does != "charging":
            self.x, self.y = self.x + way_m * cos(way_rad), self.y + way_m * sin(way_rad)
        return self.said(t_s, speed_mps, turn_radps)

    def said(self, stamp_s: float, speed_mps: float, turn_radps: float) -> bytes:
        document: dict[str, Any] = {"velocity": {"linear": speed_mps, "angular": angle(turn_radps)}}
        if self.does == "path":
            count, way_rad = self.random.randint(1, 15), self.random.uniform(-pi, pi)
            after_s = sorted(self.random.uniform(1.0, 2.0) * LONGEST_S * i / count for i in range(1, count + 1))
            mps = abs(speed_mps)
            ways = [
                (stamp_s + s, self.x + mps * s * cos(way_rad), self.y + mps * s * sin(way_rad), way_rad)
                for s in after_s
            ]
            document["path"] = points(*ways)
        here = {"x": self.x, "y": self.y, "angle": angle(self.yaw_rad), "planarDatum": self.datum}
        state = "charging" if self.does == "charging" else "navigating"
        return status(self.name, stamp_s, location=here, operationalState=state, **document)


def sent_late(random: Random) -> Iterator[Sent]:
    drivers, t_s = [LateDriver(f"R-{i}", random) for i in range(LATE_ROBOTS)], NOW_S
    for driver in drivers:
        model = random.choice(("A1", "A2"))
        yield identity(driver.name, t_s, robotModel=model, baseRobotEnvelope=driver.size_m), t_s, LINES[2]
    for _ in range(LATE_ROUNDS):
        after_s = random.choice(
            (random.uniform(2.1, COMPARED_S), random.uniform(COMPARED_S, LONGEST_S - HORIZONS_S[-1]))
        )
        t_s += after_s
        for driver in drivers:
            plain = json.loads(driver.drive(t_s, after_s), parse_float=lambda digits: round(float(digits), 6))
            yield json.dumps(plain).encode(), t_s + random.uniform(0.05, 0.5), LINES[2]


def results(
    messages: list[Sent], *, fast: bool, reading: Reading | None = None
) -> tuple[list[bytes], list[dict[str, Any]], dict[str, Any]]:
    receiving, batches = fleet(fast=fast, reading=reading), []
    for i, (raw, arrival_s, connection) in enumerate(messages):
        receiving.receive(raw, arrival_s, connection)
        if i % 4 == 0:
            batches.append(receiving.next_batch(arrival_s).to_bytes())
    measured = {name: dict(series) for name, series in receiving.measures.values.items()}
    return batches, documents(receiving, NOW_S), measured


@pytest.fixture
def repeats(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Of each status that a repeat reader was given, whether it took it."""
    taken, read = [], RepeatReader.read

    def noted(reader: RepeatReader, scanned: ScannedStatus, event_s: float) -> tuple[tuple[str, ...], Oddities] | None:
        found = read(reader, scanned, event_s)
        taken.append(found is not None)
        return found

    monkeypatch.setattr(RepeatReader, "read", noted)
    return taken


@pytest.mark.parametrize("seed", range(4))
def test_batches_documents_and_measures_are_the_same_with_and_without_the_fast_path(
    seed: int, repeats: list[bool]
) -> None:
    messages = list(sent(seed, 400))
    for fast, slow in zip(results(messages, fast=True), results(messages, fast=False), strict=True):
        assert fast == slow
    assert 0.11 * len(messages) < sum(repeats) < len(repeats) - 100


@pytest.mark.parametrize("horizon_s", HORIZONS_S)
@pytest.mark.parametrize("seed", range(4))
def test_late_statuses_take_the_fast_path_and_give_the_batches_of_the_slow_one(
    seed: int, horizon_s: float, repeats: list[bool]
) -> None:
    messages, reading = list(sent_late(Random(seed))), Reading(horizon_s=horizon_s)
    fast, slow = (results(messages, fast=is_fast, reading=reading) for is_fast in (True, False))
    assert fast == slow
    assert repeats == [True] * (LATE_ROUNDS - 1) * LATE_ROBOTS


def test_a_pace_is_learned_of_paths_without_usable_times_only(repeats: list[bool]) -> None:
    messages: list[Sent] = []
    x = 0.0
    for second in range(36):
        t_s, mps, first_s = (NOW_S + second, 1.5, NOW_S + second) if 8 <= second < 28 else (NOW_S + second, 0.5, 0.0)
        way = points(*((first_s + s, x + mps * s, 0.0, 0.0) for s in range(1, 21)))
        messages.append((status("R", t_s, x, velocity={"linear": mps}, path=way), t_s, LINES[0]))
        x += mps
    assert results(messages, fast=True) == results(messages, fast=False)
    assert any(repeats)


def test_path_times_that_hold_back_a_robot_now_and_then_are_the_same_with_and_without_the_fast_path(
    repeats: list[bool],
) -> None:
    messages: list[Sent] = []
    for second in range(40):
        t_s, late_s = NOW_S + second, 5.0 if second % 7 in (2, 4, 5, 6) else 0.0
        way = points(*((t_s + late_s + s, float(second + s), 0.0, 0.0) for s in range(1, 21)))
        messages.append((status("R", t_s, second, velocity={"linear": 1.0}, path=way), t_s, LINES[0]))
    fast, slow = (results(messages, fast=is_fast) for is_fast in (True, False))
    assert fast == slow
    assert 0 < sum(repeats) < len(repeats)
    assert fast[1][0]["deviations"]["path-retimed"] == 10


def test_a_clock_that_stands_is_the_same_with_and_without_the_fast_path(repeats: list[bool]) -> None:
    messages: list[Sent] = []
    for second in range(40):
        x, mps = float(min(second, 20)), 1.0 if second < 20 else 0.0
        raw = status("R", NOW_S, x, velocity={"linear": mps})
        messages.append((raw, NOW_S + second, LINES[0]))
    assert results(messages, fast=True) == results(messages, fast=False)
    assert any(repeats)


def calls_of_a_status(every_s: float) -> int:
    """Calls to read the last of three statuses of a robot that drives straight on."""
    receiving_fleet, calls = fleet(), 0

    def count(_: FrameType, event: str, __: object) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    for i in range(3):
        t_s = NOW_S + every_s * i
        raw = status("R", t_s, every_s * i, velocity={"linear": 1.0})
        sys.setprofile(count if i == 2 else None)
        try:
            receiving_fleet.receive(raw, t_s, LINES[0])
        finally:
            sys.setprofile(None)
    return calls


@pytest.mark.parametrize("every_s", [2.5, 8.0, 34.0])
def test_a_late_status_takes_as_few_calls_as_a_regular_one(every_s: float) -> None:
    assert calls_of_a_status(every_s) <= calls_of_a_status(1.0) + 2


@pytest.mark.parametrize(
    ("every_s", "turn_rad", "is_repeat"),
    [(36.0, 0.0, False), (8.0, 0.0, True), (8.0, 2.0, True), (1.9, 0.0, True), (1.5, 0.7, True)],
)
def test_only_a_robot_whose_reports_show_no_motion_repeats_no_status(
    repeats: list[bool], every_s: float, turn_rad: float, is_repeat: bool
) -> None:
    receiving_fleet, (x, y, yaw_rad) = fleet(), (0.0, 0.0, 0.0)
    for i in range(5):
        t_s = NOW_S + every_s * i
        here = {"x": x, "y": y, "angle": angle(yaw_rad), "planarDatum": HALL}
        after_s = 10.0 + every_s
        ways = points((t_s + after_s, x + after_s * cos(yaw_rad), y + after_s * sin(yaw_rad), yaw_rad))
        x, y, yaw_rad = x + every_s * cos(yaw_rad), y + every_s * sin(yaw_rad), yaw_rad + turn_rad
        raw = status("R", t_s, location=here, velocity={"linear": 1.0}, path=ways)
        receiving_fleet.receive(raw, t_s, LINES[0])
    assert repeats == [is_repeat] * 4


def test_the_reader_of_a_robots_repeated_statuses_is_dropped_with_the_robot(repeats: list[bool]) -> None:
    receiving_fleet, path = fleet(), points((NOW_S + 15, 15.0, 0.0, 0.0))
    for i in range(3):
        receiving_fleet.receive(status("R", NOW_S + i, i, velocity={"linear": 1.0}, path=path), NOW_S + i, LINES[0])
    assert repeats == [True, True]
    later_s = NOW_S + 1 + Reading().forget_after_s
    assert receiving_fleet.next_batch(later_s + 2).gone == (robot("R"),)
    receiving_fleet.receive(status("R", later_s + 3, 9.0, velocity={"linear": 1.0}), later_s + 3, LINES[0])
    assert receiving_fleet.next_batch(later_s + 3).robots == (robot("R"),)
    assert len(repeats) == 2


def test_changed_settings_end_the_reading_of_repeated_statuses(repeats: list[bool]) -> None:
    receiving_fleet = fleet()
    for i in range(4):
        path = points((NOW_S + i + 1, i + 1.0, 0.0, 0.0), (NOW_S + i + 10, i + 10.0, 0.0, 0.0))
        receiving_fleet.receive(status("R", NOW_S + i, i, velocity={"linear": 1.0}, path=path), NOW_S + i, LINES[0])
    assert repeats == [True, True, True]
    receiving_fleet.reconfigure(
        receiving_fleet.owners.vendors, FrameRegistry((), ()), Reading(default_envelope_m=(3.0, 2.0, 0.0))
    )
    path = points((NOW_S + 5, 5.0, 0.0, 0.0))
    receiving_fleet.receive(status("R", NOW_S + 4, 4.0, velocity={"linear": 1.0}, path=path), NOW_S + 4, LINES[0])
    assert len(repeats) == 3
    assert receiving_fleet.next_batch(NOW_S + 4).forecasts.length_m.tolist() == [3.0]
