"""Short scripts of robots through fleet and engine, for tests of contention."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import atan2, hypot
from random import Random
from typing import Any

from deconflict.engine.engine import Engine
from deconflict.settings.shared_places import Resource, Zone
from deconflict.settings.site import Site
from deconflict_client.advisory import AdvisoryState, AnyAdvisory
from deconflict_client.advisory.robot_advice import RobotAdvice
from ingest.batch import Batch
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.shown.quarantine import Quarantine
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Datum
from tests.helpers.saying import HALL, LOFT, identity, points, status

NOW_S = 1_790_000_000.0
LINE = Connection(1)

Spot = tuple[float, float]
Box = tuple[Spot, Spot, Spot, Spot]


def box(x: float, y: float, width: float = 2.0, depth: float = 2.0) -> Box:
    """A rectangle around a point."""
    w, d = width / 2, depth / 2
    return (x - w, y - d), (x + w, y - d), (x + w, y + d), (x - w, y + d)


def resource(place: str, x: float, y: float, **settings: Any) -> Resource:
    return Resource(**{"id": place, "kind": "dock", "datum": HALL, "polygon": box(x, y)} | settings)


def aisle(name: str, x0: float, x1: float, y: float = 0.0) -> Zone:
    """A lane along x."""
    outline = box((x0 + x1) / 2, y, x1 - x0, 1.6)
    return Zone(id=name, kind="aisle", datum=HALL, polygon=outline, axis=((x0, y), (x1, y)), capacity=2)


def site(*places: Resource | Zone, **settings: Any) -> Site:
    return Site(
        name="Test floor",
        datums=(Datum(id=HALL, name="Hall"), Datum(id=LOFT, name="Loft")),
        resources=tuple(place for place in places if isinstance(place, Resource)),
        zones=tuple(place for place in places if isinstance(place, Zone)),
        **settings,
    )


@dataclass
class Script:
    """One robot: where it is at given times, straight between them, and what it says."""

    knots: Sequence[tuple[float, float, float]]
    """Seconds since the start, x, y."""
    destinations: Sequence[tuple[float, float, float]] = ()
    """The same, told until it is there."""
    state: Callable[[float], str] = lambda _: "navigating"
    vendor: str = "Alder"
    datum: str = HALL
    means: Sequence[tuple[float, float, float]] | None = None
    """What it says that it will do, where that is not what it does."""
    z_m: float = 0.0
    """How high its foot is."""

    def at(self, t: float, knots: Sequence[tuple[float, float, float]] | None = None) -> tuple[float, float, float]:
        """x, y and heading."""
        knots = knots or self.knots
        after = next((row for row, knot in enumerate(knots) if knot[0] > t), len(knots))
        if after in {0, len(knots)}:
            _, x, y = knots[0 if after == 0 else -1]
            return x, y, self._heading(knots, max(after - 1, 1))
        (t0, x0, y0), (t1, x1, y1) = knots[after - 1], knots[after]
        share = (t - t0) / (t1 - t0)
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0), self._heading(knots, after)

    def _heading(self, knots: Sequence[tuple[float, float, float]], row: int) -> float:
        """Of the last leg up to this knot that goes anywhere."""
        for a, b in zip(knots[row - 1 :: -1], knots[row:0:-1], strict=False):
            if hypot(b[1] - a[1], b[2] - a[2]) > 0.01:
                return atan2(b[2] - a[2], b[1] - a[1])
        return 0.0

    def says(self, name: str, t: float, start_s: float = NOW_S) -> bytes:
        x, y, yaw = self.at(t)
        state = self.state(t)
        extra: dict[str, Any] = {"operationalState": state, "destinations": None}
        if ahead := [
            (start_s + at, to_x, to_y, 0.0)
            for at, to_x, to_y in self.destinations
            if at > t or hypot(to_x - x, to_y - y) > 0.5
        ]:
            extra["destinations"] = points(*ahead)
        if state == "navigating":
            extra["path"] = points(*((start_s + t + i, *self.at(t + i, self.means)) for i in range(1, 11)))
        message = status(name, start_s + t, x, y, yaw, **extra)
        height = b'"z": %g, "planarDatum"' % self.z_m
        return message.replace(HALL.encode(), self.datum.encode()).replace(b'"planarDatum"', height)


@dataclass
class Scene:
    """Robots that report once a second, and an engine that steps four times a second."""

    site: Site
    robots: dict[str, Script]
    advisories: list[AnyAdvisory] = field(default_factory=list)
    asked: list[RobotAdvice] = field(default_factory=list)
    """Revisions of advice to robots."""

    def __post_init__(self) -> None:
        frames = FrameRegistry(self.site.datums, self.site.vendors)
        self.fleet = Fleet(VendorRegistry(self.site.vendors), frames, self.site.reading, Measures(), Quarantine())
        self.engine = Engine(self.site)
        for name, script in self.robots.items():
            self.fleet.receive(identity(name, NOW_S, manufacturerName=script.vendor), NOW_S, LINE)

    def run(self, until_s: float, from_s: float = 0.0) -> list[AnyAdvisory]:
        """The revisions of this stretch that are not of conflicts."""
        fresh: list[AnyAdvisory] = []
        for tick in range(round(from_s * 4), round(until_s * 4)):
            t = tick / 4
            if tick % 4 == 0:
                for name, script in self.robots.items():
                    self.fleet.receive(script.says(name, t), NOW_S + t, LINE)
            self.engine.receive(Batch.from_bytes(self.fleet.next_batch(NOW_S + t).to_bytes()))
            fresh += [advisory for advisory in self.engine.step(NOW_S + t) if advisory.kind != "conflict"]
            self.asked += self.engine.advise(NOW_S + t)
        self.advisories += fresh
        return fresh


def raised(advisories: Sequence[AnyAdvisory], kind: str) -> list[AnyAdvisory]:
    return [advisory for advisory in advisories if advisory.kind == kind and advisory.state is AdvisoryState.RAISED]


def cleared(advisories: Sequence[AnyAdvisory], kind: str) -> list[AnyAdvisory]:
    return [advisory for advisory in advisories if advisory.kind == kind and advisory.state is AdvisoryState.CLEARED]


def after_s(advisory: AnyAdvisory) -> float:
    """When it was raised, since the start."""
    return advisory.raised_at.timestamp() - NOW_S


SIDES = ((1, 0), (0, 1), (-1, 0), (0, -1))
LAG_S = 0.6
"""Reports arrive so late."""


@dataclass
class Onwards(Script):
    """A robot that means to go straight on at 1 m/s, whatever it does."""

    def says(self, name: str, t: float, start_s: float = NOW_S) -> bytes:
        t = max(t - LAG_S, 0.0)
        x, y, yaw_rad = self.at(t)
        dx, dy = SIDES[round(yaw_rad / 1.5708) % 4]
        ahead = points(*((start_s + t + k, x + k * dx, y + k * dy, yaw_rad) for k in range(1, 11)))
        return status(name, start_s + t, x, y, yaw_rad, path=ahead)


def comes(side: int, to_m: float, vendor: str = "Alder", at_s: float = 8.0) -> Onwards:
    """It comes from one side, and stops with its centre `to_m` before the middle at second `at_s`."""
    dx, dy = SIDES[side % 4]
    return Onwards([(0, -(at_s + to_m) * dx, -(at_s + to_m) * dy), (at_s, -to_m * dx, -to_m * dy)], vendor=vendor)


def standoff(number: int, **settings: Any) -> Scene:
    """Two that come from neighbouring sides, and stop before the middle at second 8."""
    draw = Random(number)
    robots = {"a": comes(number, draw.uniform(1.6, 2.8)), "b": comes(number + 1, draw.uniform(1.6, 2.8), "Birch")}
    return Scene(site(**settings), dict(robots))
