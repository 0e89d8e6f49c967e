"""Logs of two robots that stand before a crossing in which nobody is, in two languages, and what a replay finds."""

import json
from dataclasses import dataclass, field
from itertools import chain
from math import cos, pi, sin
from pathlib import Path
from typing import Any

from deconflict.operator.blackbox.start_state import StartState
from deconflict.operator.ledger.loss_ledger import LedgerEntry
from deconflict.settings.shared_places import Zone
from deconflict.settings.site import Site
from deconflict_client.advisory import AnyAdvisory
from deconflict_client.situations import Situation
from ingest.languages.timestamps import write
from ingest.recording.log_reader import LogReader
from ingest.settings import Datum
from metrics.replay.engine_run import EngineRun
from metrics.replay.recorded_passes import PassReader
from tests.helpers.saying import HALL, identity, points, status
from tests.helpers.vda_saying import MAP, factsheet, node, order, topic, under_way

NOW_S = 1_790_000_000.0
MASSROBOTICS, VDA5050 = "massrobotics", "vda5050"
NEVER_S = 1000.0


@dataclass(frozen=True)
class Standoff:
    """Robots a and b drive towards one point, from the west and at an angle to that, and stop before it."""

    angle_deg: float = 90.0
    before_m: tuple[float, float] = (2.0, 2.0)
    """How far before the point the centre of each stops."""
    size_m: tuple[float, float] = (1.0, 0.8)
    stops_s: tuple[float, float] = (10.0, 10.0)
    """When each stops."""
    goes_s: tuple[float, float] = (NEVER_S, NEVER_S)
    """When each drives on."""
    vendors: tuple[str, str] = ("Alder", "Birch")
    language: str = MASSROBOTICS

    def heading_rad(self, row: int) -> float:
        return row * self.angle_deg * pi / 180

    def along_m(self, row: int, t: float) -> float:
        """How far beyond the point a robot is."""
        return min(t - self.stops_s[row], 0.0) + max(t - self.goes_s[row], 0.0) - self.before_m[row]

    def place(self, row: int, along_m: float) -> tuple[float, float]:
        yaw_rad = self.heading_rad(row)
        return along_m * cos(yaw_rad), along_m * sin(yaw_rad)

    def zone(self) -> Zone:
        """A crossing around the point that reaches nearly to the bodies."""
        half_m = min(self.before_m) - max(self.size_m) / 2 - 0.2
        ring = [(half_m * cos(k * pi / 8), half_m * sin(k * pi / 8)) for k in range(16)]
        datum = HALL if self.language == MASSROBOTICS else MAP
        return Zone(id="c", kind="crossing", datum=datum, polygon=tuple(ring), capacity=1)

    def log(self, path: Path, until_s: int) -> Path:
        lines = self._massrobotics(until_s) if self.language == MASSROBOTICS else self._vda(until_s)
        path.write_text("".join(f"{json.dumps(each)}\n" for each in lines))
        return path

    def _massrobotics(self, until_s: int) -> list[dict[str, Any]]:
        envelope = dict(zip("xyz", (*self.size_m, 1.0), strict=True))
        lines = []
        for row, name in enumerate("ab"):
            raw = identity(name, NOW_S, manufacturerName=self.vendors[row], baseRobotEnvelope=envelope)
            lines.append({"received": write(NOW_S), "message": json.loads(raw)})
        for second in range(until_s):
            for row, name in enumerate("ab"):
                t_s, yaw_rad, at_m = NOW_S + second + 0.2 * row, self.heading_rad(row), self.along_m(row, second)
                ahead = points(*((t_s + k, *self.place(row, at_m + k), yaw_rad) for k in range(1, 11)))
                raw = status(name, t_s, *self.place(row, at_m), yaw_rad, path=ahead)
                lines.append({"received": write(t_s + 0.05), "message": json.loads(raw)})
        return lines

    def _vda(self, until_s: int) -> list[dict[str, Any]]:
        """Each has an order up to where it stops, and further unreleased, until it is released."""
        body = {"length": self.size_m[0], "width": self.size_m[1], "heightMax": 1.5, "speedMax": 1.0}
        lines = []

        def say(kind: str, row: int, t_s: float, raw: bytes) -> None:
            payload = json.loads(raw) | {"manufacturer": self.vendors[row], "serialNumber": "ab"[row]}
            lines.append({"time": write(t_s), "topic": topic(kind, "ab"[row], self.vendors[row]), "payload": payload})

        for row in range(2):
            say("factsheet", row, NOW_S, factsheet(NOW_S, physicalParameters=body))
            say("order", row, NOW_S, order(NOW_S, self._nodes(row, released=False)))
        for second in range(until_s):
            for row in range(2):
                t_s, at_m = NOW_S + second + 0.2 * row, self.along_m(row, second)
                goes = second >= self.goes_s[row]
                if second == self.goes_s[row]:
                    say("order", row, t_s, order(t_s, self._nodes(row, released=True), orderUpdateId=1))
                left = self._nodes(row, released=goes)[1 if second < self.stops_s[row] else 2 :]
                drives = goes or second < self.stops_s[row]
                speed = {"vx": 1.0 if drives else 0.0, "vy": 0.0, "omega": 0.0}
                keys: dict[str, Any] = {
                    "driving": drives,
                    "velocity": speed,
                    "newBaseRequest": not drives,
                    "orderUpdateId": int(goes),
                }
                raw = under_way(t_s, *self.place(row, at_m), left, theta=self.heading_rad(row), **keys)
                say("state", row, t_s + 0.05, raw)
        return lines

    def _nodes(self, row: int, *, released: bool) -> list[dict[str, Any]]:
        starts_m = -self.stops_s[row] - self.before_m[row]
        ends = ((starts_m, True), (-self.before_m[row], True), (10.0, released))
        return [node(number, *self.place(row, at_m), released=is_base) for number, (at_m, is_base) in enumerate(ends)]


@dataclass
class Found:
    """What a replay found, with seconds since the begin of the log."""

    advisories: list[tuple[float, AnyAdvisory]] = field(default_factory=list)
    situations: list[tuple[float, Situation]] = field(default_factory=list)
    losses: list[LedgerEntry] = field(default_factory=list)

    def of_kind(self, kind: str) -> list[tuple[float, AnyAdvisory]]:
        return [(at_s, advisory) for at_s, advisory in self.advisories if advisory.kind == kind]

    def lost_s(self, vendor: str) -> float:
        return sum(loss.lost_s for loss in self.losses if loss.vendor == vendor)


def found_in(standoff: Standoff, folder: Path, until_s: int = 60, *, has_zone: bool = False) -> Found:
    datum = HALL if standoff.language == MASSROBOTICS else MAP
    site = Site(datums=(Datum(id=datum, name="Hall"),), zones=(standoff.zone(),) if has_zone else ())
    reader, found = PassReader(site), Found()
    run = EngineRun(site, site.conflict.clearance_m, StartState())
    events = LogReader().read([standoff.log(folder / "log.jsonl", until_s)])
    for each in chain(reader.passes_of(events), reader.last_passes()):
        output, at_s = run.advance(each), each.now_s - NOW_S
        found.advisories += [(at_s, advisory) for advisory in output.advisories]
        found.situations += [(at_s, situation) for situation in output.situations]
        found.losses += output.losses
    return found
