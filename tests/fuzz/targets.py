"""What is fuzzed: each target takes any bytes and raises where a promise is broken."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from deconflict.advisory import ADVISORY
from deconflict.engine.engine import Engine
from deconflict.settings.site import Site, SiteError, fit_problems, site_from_toml
from ingest.batch import Batch, Floats
from ingest.fleet import fleet_report
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.quarantine import Quarantine
from ingest.frames.frame_registry import FrameRegistry
from ingest.languages.massrobotics.conformance_rules import RULES
from ingest.languages.massrobotics.message_document import message_document
from ingest.languages.massrobotics.parser import read
from ingest.languages.model import Rejection
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Datum, Reading, Vendor
from tests.fuzz.mutation import JSON, TOML, Format
from tests.helpers.made_site import sound, toml
from tests.helpers.saying import HALL, LOFT, identity, points, robot, status
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
"""How long after the last message an engine looks: at once, when robots have fallen silent, and a day later."""


def message(raw: bytes) -> None:
    """One message gets one of three answers, and one that is accepted can be told again as JSON."""
    told = read(raw, names_as_uuid="Basalt" if len(raw) % 2 else None)
    assert set(told.findings) <= RULES.keys(), told.findings
    if isinstance(told, Rejection):
        assert RULES[told.rule].rejects, told.rule
        assert told.reason
    else:
        json.dumps(message_document(raw), allow_nan=False)


def floor(raw: bytes) -> None:
    """What several speakers say, a message a line, goes all the way to advisories; ticks fall between them."""
    fleet = Fleet(VendorRegistry(SITE.vendors), FRAMES, SITE.reading, Measures(), Quarantine())
    engine = Engine(SITE)
    lines = raw.split(b"\n")[:12]
    for number, line in enumerate(lines):
        speaker = SPEAKERS[len(line) % len(SPEAKERS)]
        now_s = T + number * TICK_S
        rule = fleet.receive(line, now_s, speaker)
        assert rule is None or RULES[rule].rejects, rule
        if number % TICKS == 0:
            _step(engine, fleet.next_batch(now_s))
    now_s = T + len(lines) * TICK_S
    json.dumps(fleet_report.robot_documents(fleet, now_s), allow_nan=False)
    for after_s in ENDS_S[len(raw) % len(ENDS_S)]:
        _step(engine, fleet.next_batch(now_s + after_s))
    fleet_report.measure(fleet, now_s)


def _step(engine: Engine, batch: Batch) -> None:
    batch = Batch.from_bytes(batch.to_bytes())
    _sound(batch)
    engine.receive(batch)
    for told in engine.step(batch.now_s):
        assert ADVISORY.validate_json(told.model_dump_json()).id == told.id
    assert all(0 <= probability <= 1 for _, probability in engine.probabilities())


def _sound(batch: Batch) -> None:
    one = batch.forecasts
    for column in (one.t_s, one.x_m, one.y_m, one.yaw_rad, one.length_m, one.width_m):
        assert np.isfinite(column).all(), column
    assert (np.abs(one.x_m) < 1e8).all()
    assert all(_increasing(one.t_s[a:b]) for a, b in zip(one.start, one.start[1:], strict=False))
    assert (one.floor < len(batch.floors)).all()
    json.dumps([batch.vendors, batch.names, batch.states])


def _increasing(t_s: Floats) -> bool:
    return bool((np.diff(t_s) > 0).all())


def site(raw: bytes) -> None:
    """A site file is taken, or refused with what to change."""
    told: Site | SiteError
    try:
        told = site_from_toml(raw, Path("site.toml"))
    except SiteError as error:
        told = error
    if isinstance(told, SiteError):
        assert all(told.problems)
        assert told.problems
        return
    assert Site.model_validate_json(told.model_dump_json()) == told
    if not fit_problems(told):
        FrameRegistry(told.datums, told.vendors)


@dataclass(frozen=True, slots=True)
class Target:
    """A function to fuzz, what its input is, and inputs to begin with."""

    run: Callable[[bytes], None]
    form: Format
    seeds: tuple[bytes, ...]


def _meeting() -> bytes:
    """Two robots that identify themselves and are about to meet, a line each message."""
    told = [identity("A-1", T), identity("B-1", T, manufacturerName="Basalt")]
    for i in range(4):
        t_s = T + i
        told.append(
            status("A-1", t_s, -3.0 + i, 0.0, path=points(*((t_s + k, -3.0 + i + k, 0.0, 0.0) for k in (1, 9))))
        )
        told.append(status("B-1", t_s, 3.0 - i, 0.0, path=points(*((t_s + k, 3.0 - i - k, 0.0, 3.14) for k in (1, 9)))))
    return b"\n".join(told)


_MESSAGES = tuple(vector.raw for vector in VECTORS)
_LINES: Format = (
    lambda raw: [json.loads(line) for line in raw.split(b"\n")],
    lambda told: b"\n".join(json.dumps(line).encode() for line in told),
)
TARGETS = {
    "message": Target(message, JSON, _MESSAGES),
    "floor": Target(floor, _LINES, (_meeting(), *(b"\n".join(_MESSAGES[i::40]) for i in range(40)))),
    "site": Target(site, TOML, (toml(sound()).encode(),)),
}
