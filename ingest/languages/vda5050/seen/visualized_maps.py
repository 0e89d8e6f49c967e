"""The map of visualizations that name it otherwise than the states of their robot, as "default" or an empty name."""

from math import hypot

import msgspec

from ingest.languages.model import BESIDE_M, datum_name
from ingest.languages.vda5050.seen.travels import OBSERVABLE_S
from ingest.languages.vda5050.vda_messages import Position

MOST_MAPS = 100
MOST_MPS = 2.0
"""A robot is about where its state put it, if it would not have driven there faster."""


class StatedPlace(msgspec.Struct, frozen=True, gc=False):
    """Where the newest state put the robot."""

    t_s: float
    position: Position

    @property
    def map(self) -> str:
        return datum_name(self.position.map_id)


class VisualizedMap(msgspec.Struct, frozen=True, gc=False):
    """What visualizations call the map of the states."""

    stated: StatedPlace | None = None
    newest: str = ""
    """The name in the newest visualization; "" before the first."""
    is_between: bool = False
    """Whether the newest state came after that."""
    other_name: str = ""
    """The name in visualizations that stands for the map of the states; "" if none is known."""
    of_states: frozenset[str] = frozenset()
    """The maps of all states, which stand for no other."""

    def after_state(self, t_s: float, position: Position) -> "VisualizedMap":
        stated, of_states = StatedPlace(t_s, position), self.of_states
        if stated.map not in of_states and len(of_states) < MOST_MAPS:
            of_states |= {stated.map}
        other_name = "" if stated.map == self.other_name else self.other_name
        return VisualizedMap(stated, self.newest, True, other_name, of_states)

    def after_visualization(self, t_s: float, position: Position) -> "VisualizedMap":
        """A name stands for the map of the states if the first visualization has it, or a state between two of them
        still has its own. A robot that changes the map names the new one in its next state."""
        name, stated = datum_name(position.map_id), self.stated
        other_name = self.other_name
        is_shown = self.newest == "" or (self.newest == name and self.is_between)
        is_foreign = bool(name) and name not in self.of_states
        if stated and stated.map and is_foreign and is_shown and _is_about(stated, t_s, position):
            other_name = name
        return VisualizedMap(stated, name, False, other_name, self.of_states)

    def map_of(self, position: Position) -> str | None:
        """The map that is meant by the position of a visualization; None if it is the one that it names."""
        name = datum_name(position.map_id)
        return self.stated.position.map_id if self.stated and name and name == self.other_name else None


def _is_about(stated: StatedPlace, t_s: float, position: Position) -> bool:
    """Whether a robot may be at a position if it was at that of its state, in the same coordinates."""
    lasted_s = abs(t_s - stated.t_s)
    away_m = hypot(position.x - stated.position.x, position.y - stated.position.y)
    return lasted_s <= OBSERVABLE_S and away_m <= BESIDE_M + MOST_MPS * lasted_s
