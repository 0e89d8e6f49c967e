"""One robot as its messages tell of it, and what people are shown of that."""

from dataclasses import dataclass, field
from math import dist, isfinite, isnan, nan
from typing import Any

from ingest.batch import Basis, Floats
from ingest.clocks import SenderClock
from ingest.fleet.forecast import NO_STOPS, Forecast, Sighting, View
from ingest.fleet.introductions import Introduction
from ingest.frames.frame_registry import Frame
from ingest.languages.massrobotics import parser
from ingest.languages.model import Identity


@dataclass(slots=True, eq=False)
class Robot:
    """What one robot said last, and what was made of it."""

    uuid: str
    vendor: str
    clock: SenderClock
    name: str = field(init=False)
    """What a person calls the robot."""
    model: str = field(init=False)
    """As its vendor names it; "" before it has identified itself."""
    identity: Identity | None = None
    introduction: Introduction | None = None
    """The report that its identity was read from."""
    status_raw: bytes = b""
    state: str = ""
    known_state: bool = True
    statuses: int = 0
    """How many came since the robot was last in a batch."""
    first_arrival_s: float = nan
    """When the first of them arrived."""
    arrival_s: float = nan
    seen: Sighting | None = None
    """The newest sighting, headings and speeds reconciled with the one before it."""
    frame: Frame | None = None
    forecast: Forecast | None = None
    stops: Floats = field(default_factory=lambda: NO_STOPS)
    """As `ingest/fleet/forecast.py` has them."""
    doubt_m: float = 0.0
    battery_pct: float = nan
    run_time_left_s: float = nan
    """How much longer its battery lasts, by its newest status as the level; nan where that does not say."""
    owned: bool = False
    """Whether its vendor is settled: it identified itself, or spoke over a connection of that vendor."""
    view: View | None = None
    """How its messages are read; None where something of that may have changed."""
    view_of: tuple[bool, str] = (False, "")
    """What the view is of: whether the robot is loaded, and its datum."""
    uuid_as_sent: bytes = b""
    """Where the fast path has a reader of its repeated statuses."""
    deviations: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.settle(self.vendor)

    def settle(self, vendor: str) -> None:
        """Be a vendor's robot, by the identity that it has now."""
        self.vendor, self.view = vendor, None
        self.model = self.identity.model if self.identity else ""
        serial = self.identity.serial if self.identity else self.uuid[:8]
        self.name = serial if serial.casefold().startswith(vendor.casefold()) else f"{vendor} {serial}"


def told(robot: Robot, raw: bytes) -> dict[str, Any] | None:
    """What a message said, under the UUID that it was read as: the sender's own may be a name."""
    return parser.document(raw) | {"uuid": robot.uuid} if raw else None


def placed(robot: Robot) -> dict[str, Any]:
    """The floor-frame part of a robot's document; absent before its first status."""
    if not (robot.seen and robot.frame and robot.forecast):
        return {"floor": None, "location": None, "envelope": None, "forecast": None}
    one, seen = robot.forecast, robot.seen
    tall = isfinite(one.top_m)
    return {
        "floor": robot.frame.floor,
        "comparable": robot.frame.comparable,
        "location": {"x": seen.x_m, "y": seen.y_m, "yaw_rad": None if isnan(seen.yaw_rad) else seen.yaw_rad},
        "event_s": seen.t_s,
        "doubt_m": robot.doubt_m,
        "envelope": {
            "length_m": one.length_m,
            "width_m": one.width_m,
            "height_m": one.top_m - one.bottom_m if tall else None,
        },
        "forecast": {
            "basis": Basis(one.basis).name.lower(),
            "reach_m": round(dist(one.knots[0][1:3], one.knots[-1][1:3]), 3),
            "knots": [[round(float(value), 3) for value in knot] for knot in one.knots],
        },
    }
