"""What is known of one robot, as contention asks of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from deconflict.contention.robots.destinations import Stop
from deconflict.contention.robots.lookahead import STEP_S, STEPS
from deconflict.contention.robots.place_geometry import Passage


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """One robot, as last heard of."""

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
    """Heights that it reaches from and to; -inf and inf where they are unknown."""
    top_m: float
    way_m: float
    """How far it gets in the next ten seconds."""
    stood_s: float
    """Since when it stands where it is."""
    goes: bool
    """Whether it is forecast to move."""
    stands: bool
    """Whether it is at rest, whatever it says: it has not moved for a while, or is not to."""
    datum: str
    """Of where it is; "" where it is compared with nothing."""
    here: str | None = None
    """The resource it has."""
    came_s: float = 0.0
    """Since when it has that."""
    stops: tuple[Stop, ...] = ()
    """By time, without any that it is at already."""
    passages: Mapping[str, Passage] = field(default_factory=dict)
    """By zone."""

    @property
    def speed_mps(self) -> float:
        """Along its way; walking pace where it is not forecast to move."""
        return max(self.way_m / (STEPS * STEP_S), 0.2) if self.goes else 1.0
