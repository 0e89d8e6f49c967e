"""What is kept of a robot between two of its messages."""

from math import isnan

import msgspec

from ingest.languages.geometry.trajectories import Curve
from ingest.languages.model import NO_PATH, Path
from ingest.languages.timestamps import Stamp
from ingest.languages.tolerance.heard import Heard
from ingest.languages.vda5050.orders import Order
from ingest.languages.vda5050.seen.base_ends import BaseEnds
from ingest.languages.vda5050.seen.known_ways import KnownWays
from ingest.languages.vda5050.seen.line_guided import Along
from ingest.languages.vda5050.seen.travels import OBSERVABLE_S, Travel
from ingest.languages.vda5050.seen.visualized_maps import VisualizedMap
from ingest.languages.vda5050.vda_messages import Position, StateMessage, Velocity2d


class Plans(msgspec.Struct, frozen=True, gc=False):
    """Where a robot will drive by its own plans, as a state or a visualization has them."""

    stamp_s: float
    path: Path = NO_PATH
    """Its `intermediatePath`."""
    curve: Curve | None = None
    """Its `plannedPath`."""


class VdaPose(msgspec.Struct, frozen=True, gc=False):
    """The newest report of where a robot is, of a state or a visualization."""

    stamp: Stamp
    position: Position
    velocity: Velocity2d | None
    path: Path
    """That it plans itself, with its own times."""
    plan: Curve | None
    """The way that it plans, without times."""
    travel: Travel
    along: Along | None = None
    """How it was placed, if it did not say where it is."""

    def gives_way_to_nodes(self, t_s: float) -> bool:
        """Whether the nodes that the robot passes say more of its place, since it last said that long before."""
        return self.along is not None or t_s > self.stamp.t_s + OBSERVABLE_S

    @property
    def motion(self) -> Velocity2d | None:
        """The velocity as sent, else as observed."""
        sent, seen = self.velocity, self.travel
        if isnan(seen.direction_rad) or (sent and not (sent.vx is None and sent.vy is None)):
            return sent
        return Velocity2d(-seen.mps if seen.is_backwards else seen.mps, 0.0, sent.omega if sent else None)


class Abilities(msgspec.Struct, frozen=True, gc=False):
    """What a robot's factsheet says of how it drives. None if it does not say it."""

    max_speed_mps: float | None = None
    max_turn_radps: float | None = None
    is_omnidirectional: bool = False


class VdaMemory(msgspec.Struct, frozen=True, gc=False):
    """All that is kept of a robot."""

    heard: dict[str, Heard] = {}
    """By kind of message."""
    respelt: frozenset[str] = frozenset()
    """Kinds of messages of which any had keys in another spelling."""
    state: StateMessage | None = None
    pose: VdaPose | None = None
    plans: dict[str, Plans] = {}
    """By kind of message, those of the newest one."""
    orders: tuple[Order, ...] = ()
    """The last two, the newest last."""
    outdated: Order | None = None
    """The newest update that was older than its order, until a further order. The robot may have taken it."""
    ways: KnownWays = KnownWays()
    """Of all orders."""
    unheard: Order | None = None
    """What is known of the order of the newest state, if that was not heard."""
    filled: frozenset[tuple[str, str]] = frozenset()
    """Of which kinds of messages heading and velocity are filled in, see `filled_in`."""
    lists_nodes: bool = False
    """Whether any state named nodes that remain."""
    visualized: VisualizedMap = VisualizedMap()
    are_headings_default: bool = False
    """Whether nodes have a heading only since nobody left it out."""
    is_order_newer: bool = False
    """Whether the newest order came after the newest state, which therefore does not show it."""
    bases: BaseEnds = BaseEnds()
    abilities: Abilities = Abilities()
    connection: str = ""
    """The newest connection state."""


NOTHING = VdaMemory()
