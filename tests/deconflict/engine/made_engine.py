"""A floor of robots on given courses, stepped through fleet and engine."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import pi
from typing import Any

from deconflict.engine.engine import Engine
from deconflict.engine.load_shedding import Effort
from deconflict.settings.site import Conflict, Site
from deconflict_client.advisory import ConflictAdvisory
from ingest.batch import Batch
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.shown.quarantine import Quarantine
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Datum
from tests.helpers.saying import HALL, LOFT, identity, points, status

SITE = Site(
    name="Test floor",
    datums=(Datum(id=HALL, name="Hall"), Datum(id=LOFT, name="Loft")),
    conflict=Conflict(clearance_m=0.3, confirm=(2, 3)),
)


NOW_S = 1_790_000_000.0


LINE = Connection(1)


Course = Callable[[float], tuple[float, float, float]]
"""Seconds since the start to x, y, yaw."""


def eastward(speed_mps: float = 1.0, x: float = 0.0, y: float = 0.0) -> Course:
    return lambda t: (x + speed_mps * t, y, 0.0)


def northward(speed_mps: float = 1.0, x: float = 0.0, y: float = 0.0) -> Course:
    return lambda t: (x, y + speed_mps * t, pi / 2)


@dataclass
class Floor:
    """Robots that report once a second, and an engine that steps four times a second."""

    courses: dict[str, Course]
    datum: dict[str, str] = field(default_factory=dict)
    silent_from_s: dict[str, float] = field(default_factory=dict)
    site: Site = SITE
    makers: dict[str, str] = field(default_factory=dict)
    effort: Effort = Effort.FULL
    pending: dict[int, int] = field(default_factory=dict)
    """By step, the answers that were not there; as the engine says where it is not given."""
    advisories: list[ConflictAdvisory] = field(default_factory=list)

    def __post_init__(self) -> None:
        frames = FrameRegistry(self.site.datums, self.site.vendors)
        self.fleet = Fleet(VendorRegistry(self.site.vendors), frames, self.site.reading, Measures(), Quarantine())
        self.engine = Engine(self.site)

    def run(self, until_s: float, from_s: float = 0.0) -> list[ConflictAdvisory]:
        """The revisions of this stretch."""
        advisories: list[ConflictAdvisory] = []
        for tick in range(round(from_s * 4), round(until_s * 4)):
            t = tick / 4
            if tick % 4 == 0:
                for name in self.courses:
                    if t < self.silent_from_s.get(name, float("inf")):
                        self._report(name, t)
            self.engine.receive(Batch.from_bytes(self.fleet.next_batch(NOW_S + t).to_bytes()))
            pending = self.pending.setdefault(tick, self.engine.pending())
            revisions = self.engine.step(NOW_S + t, self.effort, pending)
            advisories += [revision for revision in revisions if isinstance(revision, ConflictAdvisory)]
        self.advisories += advisories
        return advisories

    def _report(self, name: str, t: float) -> None:
        course, datum = self.courses[name], self.datum.get(name, HALL)
        if t == 0:
            self.fleet.receive(identity(name, NOW_S, manufacturerName=self.makers.get(name, "Alder")), NOW_S, LINE)
        x, y, yaw = course(t)
        path = points(*((NOW_S + t + i, *course(t + i)) for i in range(1, 11)))
        location = {"x": x, "y": y, "angle": path[0]["angle"], "planarDatum": datum}
        document: dict[str, Any] = {"path": path, "location": location}
        self.fleet.receive(status(name, NOW_S + t, yaw_rad=yaw, **document), NOW_S + t, LINE)
