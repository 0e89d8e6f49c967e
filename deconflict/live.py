"""What the engine knows of each robot: its newest row of a batch."""

from dataclasses import dataclass, field

from ingest.seam import Basis, Batch, Forecasts


@dataclass(slots=True, eq=False)
class LiveRobot:
    """One robot on the floor, until it is said to be gone: silence never removes it."""

    vendor: str
    model: str
    name: str
    state: str
    basis: Basis
    event_s: float
    doubt_m: float
    forecast: Forecasts
    """Of this robot alone, envelope as reported."""
    growth_m: float = 0.0
    """How far its uncertainty has grown since it fell quiet."""


@dataclass(slots=True, eq=False)
class Live:
    """Every robot on every floor."""

    robots: dict[str, LiveRobot] = field(default_factory=dict)
    floors: tuple[str, ...] = ()

    def put(self, batch: Batch, row: int) -> LiveRobot:
        """Replace what is known of the robot in `row`."""
        self.floors = batch.floors
        robot = LiveRobot(
            vendor=batch.vendors[row],
            model=batch.models[row],
            name=batch.names[row],
            state=batch.states[row],
            basis=Basis(int(batch.basis[row])),
            event_s=float(batch.event_s[row]),
            doubt_m=float(batch.doubt_m[row]),
            forecast=batch.forecasts.one(row),
        )
        self.robots[batch.robots[row]] = robot
        return robot
