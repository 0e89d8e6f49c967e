"""The fuzz targets. Each takes any bytes and raises if a promise is broken."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from deconflict.engine.engine import Engine
from deconflict.settings.site import Site
from deconflict.settings.site_file import SiteError, fit_problems, site_from_toml
from deconflict_client.advisory import ADVISORY
from ingest.batch import Batch, Floats
from ingest.fleet import fleet_report
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.shown.quarantine import Quarantine
from ingest.frames.frame_registry import FrameRegistry
from ingest.languages.front_ends import FRONT_ENDS
from ingest.languages.massrobotics.conformance_rules import RULES
from ingest.languages.massrobotics.massrobotics_front_end import message_document
from ingest.languages.massrobotics.parser import read
from ingest.languages.model import Rejection
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Datum, Reading, Vendor
from tests.fuzz.mutation import JSON, TOML, Format
from tests.helpers import iso_saying, vda_vectors
from tests.helpers.iso_saying import line as iso_line
from tests.helpers.made_site import sound, toml
from tests.helpers.saying import HALL, LOFT, identity, points, robot, status
from tests.helpers.vda_saying import line as vda_line
from tests.helpers.vectors import VECTORS, T

SITE = Site(
    datums=(
        Datum(id=HALL, name="Hall"),
        Datum(id=LOFT, name="Loft", coordinates="latlon", reference_location=(42, -71)),
    ),
    vendors=(Vendor(name="Alder", robots=(robot("A-1"),)), Vendor(name="Basalt", names_as_uuid=True)),
    reading=Reading(max_robots_per_vendor=4),
)
FRAMES = FrameRegistry(SITE.datums, SITE.vendors)
SPEAKERS = (Connection(1, path="/Alder", vendor="Alder"), Connection(2, path="/Basalt", vendor="Basalt"), Connection(3))
TICKS = 3
TICK_S = 0.5
ENDS_S = ((0.0, 0.5), (0.0, 40.0), (0.0, 90_000.0), (0.5, 40.0, 90_000.0))
"""How long after the last message the engine runs: at once, when robots have fallen silent, and a day later."""


def message(raw: bytes) -> None:
    """A message gives an identity, a status or a rejection. An accepted one can be written as JSON."""
    message = read(raw, names_as_uuid="Basalt" if len(raw) % 2 else None)
    assert set(message.findings) <= RULES.keys(), message.findings
    if isinstance(message, Rejection):
        assert RULES[message.rule].rejects, message.rule
        assert message.reason
    else:
        json.dumps(message_document(raw), allow_nan=False)


def floor(raw: bytes) -> None:
    """Messages of several senders, one per line, go all the way to advisories, with ticks between them."""
    _floor(raw, lambda line: SPEAKERS[len(line) % len(SPEAKERS)], T)


def vda5050(raw: bytes) -> None:
    """The same for messages of brokers. Keys decide on which topic of two robots a line comes."""
    _floor(raw, lambda line: vda_line(_kind(line), ("0001", "0002")[len(line) % 2]), vda_vectors.T)


def iso21423(raw: bytes) -> None:
    """The same for robots of ISO 21423."""
    uuids = "91403a21-7534-4467-99a6-79c46a130fe8", "a-name"
    _floor(raw, lambda line: iso_line(_resource(line), uuids[len(line) % 2]), vda_vectors.T)


def _resource(raw: bytes) -> str:
    marks = {
        b"Footprint": "identity",
        b"footprint": "footprint",
        b"localTraj": "localTrajectory",
        b"Plan": "globalPlan",
    }
    others = {b"states": "status", b"battery": "batteryStatus"}
    return next((resource for mark, resource in (marks | others).items() if mark in raw), "odometry")


def _kind(raw: bytes) -> str:
    marks = {b"physicalParameters": "factsheet", b'"nodes"': "order", b"connectionState": "connection"}
    found = (kind for mark, kind in marks.items() if mark in raw)
    return next(found, "state" if b"operatingMode" in raw else "visualization")


def _floor(raw: bytes, speaker_of: Callable[[bytes], Connection], start_s: float) -> None:
    fleet = Fleet(VendorRegistry(SITE.vendors), FRAMES, SITE.reading, Measures(), Quarantine())
    engine = Engine(SITE)
    lines = raw.split(b"\n")[:12]
    for number, line in enumerate(lines):
        speaker = speaker_of(line)
        now_s = start_s + number * TICK_S
        rule = fleet.receive(line, now_s, speaker)
        assert rule is None or FRONT_ENDS[speaker.language].rules[rule].rejects, rule
        if number % TICKS == 0:
            _step(engine, fleet.next_batch(now_s))
    now_s = start_s + len(lines) * TICK_S
    json.dumps([fleet_report.robot_document(fleet, robot, now_s) for robot in fleet.robots.values()], allow_nan=False)
    for after_s in ENDS_S[len(raw) % len(ENDS_S)]:
        _step(engine, fleet.next_batch(now_s + after_s))
    fleet_report.measure(fleet, now_s)


def _step(engine: Engine, batch: Batch) -> None:
    batch = Batch.from_bytes(batch.to_bytes())
    _sound(batch)
    engine.receive(batch)
    for revision in engine.step(batch.now_s):
        assert ADVISORY.validate_json(revision.model_dump_json()).id == revision.id
    assert all(0 <= probability <= 1 for _, probability in engine.probabilities())


def _sound(batch: Batch) -> None:
    forecasts = batch.forecasts
    for column in (
        forecasts.t_s,
        forecasts.x_m,
        forecasts.y_m,
        forecasts.yaw_rad,
        forecasts.length_m,
        forecasts.width_m,
    ):
        assert np.isfinite(column).all(), column
    assert (np.abs(forecasts.x_m) < 1e8).all()
    assert all(_increasing(forecasts.t_s[a:b]) for a, b in zip(forecasts.start, forecasts.start[1:], strict=False))
    assert (forecasts.floor < len(batch.floors)).all()
    json.dumps([batch.vendors, batch.names, batch.states])


def _increasing(t_s: Floats) -> bool:
    return bool((np.diff(t_s) > 0).all())


def site(raw: bytes) -> None:
    """A site file is accepted, or refused with a message that says what to change."""
    result: Site | SiteError
    try:
        result = site_from_toml(raw, Path("site.toml"))
    except SiteError as error:
        result = error
    if isinstance(result, SiteError):
        assert all(result.problems)
        assert result.problems
        return
    assert Site.model_validate_json(result.model_dump_json()) == result
    if not fit_problems(result):
        FrameRegistry(result.datums, result.vendors)


@dataclass(frozen=True, slots=True)
class Target:
    """A function to fuzz, the format of its input, and inputs to start from."""

    run: Callable[[bytes], None]
    form: Format
    seeds: tuple[bytes, ...]


def _meeting() -> bytes:
    """Messages of two robots that identify themselves and are about to meet, one per line."""
    messages = [identity("A-1", T), identity("B-1", T, manufacturerName="Basalt")]
    for i in range(4):
        t_s = T + i
        messages.append(
            status("A-1", t_s, -3.0 + i, 0.0, path=points(*((t_s + k, -3.0 + i + k, 0.0, 0.0) for k in (1, 9))))
        )
        messages.append(
            status("B-1", t_s, 3.0 - i, 0.0, path=points(*((t_s + k, 3.0 - i - k, 0.0, 3.14) for k in (1, 9))))
        )
    return b"\n".join(messages)


_MESSAGES = tuple(vector.raw for vector in VECTORS)
_VDA = tuple(vector.raw for vector in vda_vectors.VECTORS if len(vector.raw) < 5000)
_ISO = (
    iso_saying.identity(vda_vectors.T),
    iso_saying.states(vda_vectors.T, "MODE_AUTO", "FORWARD"),
    iso_saying.odometry(vda_vectors.T, 1.0, 2.0, 0.5, 1.0),
    iso_saying.trajectory(vda_vectors.T, *((vda_vectors.T + i, 1.0 + i, 2.0) for i in range(1, 5))),
    iso_saying.odometry(vda_vectors.T + 1, 2.0, 2.0, 0.5, 1.0),
    iso_saying.iso(vda_vectors.T, footprint=iso_saying.SQUARE, height=2.0),
    iso_saying.iso(vda_vectors.T, batterySoc=0.5),
    iso_saying.iso(vda_vectors.T, globalPlan=iso_saying.points((vda_vectors.T + 60, 9.0, 9.0))),
)
_LINES: Format = (
    lambda raw: [json.loads(line) for line in raw.split(b"\n")],
    lambda documents: b"\n".join(json.dumps(document).encode() for document in documents),
)
TARGETS = {
    "message": Target(message, JSON, _MESSAGES),
    "floor": Target(floor, _LINES, (_meeting(), *(b"\n".join(_MESSAGES[i::40]) for i in range(40)))),
    "vda5050": Target(vda5050, _LINES, tuple(b"\n".join(_VDA[i::12]) for i in range(12))),
    "iso21423": Target(iso21423, _LINES, (b"\n".join(_ISO), b"\n".join(_ISO[::-1]))),
    "site": Target(site, TOML, (toml(sound()).encode(),)),
}
