"""What is known of one robot, as contention asks for it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from deconflict.contention.robots.destinations import PlannedStop
from deconflict.contention.robots.lookahead import STEP_S, STEPS
from deconflict.contention.robots.place_geometry import ZonePassage


@dataclass(frozen=True, slots=True, eq=False)
class RobotView:
    """One robot, by its newest report."""

    uuid: str
    vendor: str
    name: str
    state: str
    event_s: float
    x_m: float
    y_m: float
    length_m: float
    width_m: float
    bottom_m: float
    """The lowest height it reaches; -inf if it is not known."""
    top_m: float
    """The highest height it reaches; inf if it is not known."""
    way_m: float
    """How far it gets in the next ten seconds."""
    stood_s: float
    """Since when it stands where it is."""
    goes: bool
    """Whether it is forecast to move."""
    stands: bool
    """Whether it is at rest, whatever it reports: it has not moved for a while, or is not forecast to."""
    datum: str
    """Datum of its floor; "" if its floor is not known."""
    here: str | None = None
    """The resource it has; None if it has none."""
    came_s: float = 0.0
    """Since when it has the resource."""
    stops: tuple[PlannedStop, ...] = ()
    """Its next stops by time, without those it is at already."""
    passages: Mapping[str, ZonePassage] = field(default_factory=dict)
    """Its passages by zone."""

    @property
    def speed_mps(self) -> float:
        """Along its path; walking pace if it is not forecast to move."""
        return max(self.way_m / (STEPS * STEP_S), 0.2) if self.goes else 1.0
