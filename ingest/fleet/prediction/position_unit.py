"""Positions in another unit than metres, as the speed shows with which they move.

One move shows nothing: robots are carried, relocate themselves, or share a UUID. Several in a row and in one direction
do, each near `UNITS` times as fast as the robot says that it drives.
"""

from math import hypot
from typing import NamedTuple

from ingest.fleet.prediction.forecast_model import Sighting
from ingest.fleet.prediction.plausibility import OBSERVABLE_S
from ingest.languages.front_ends import MASSROBOTICS
from ingest.languages.rules import POSITION_IN_OTHER_UNIT, Oddity
from ingest.sizes.size_limit import UNITS, are_within

LEAST_MPS = 0.2
"""At a lower speed than this, noise of positions may look like another unit."""
NEAR = 1.5
"""How much the speed of positions may differ from the speed that is expected in another unit."""
LEAST_MOVES = 3
"""Moves in a row that show another unit."""
LOCATIONS = {MASSROBOTICS: "location", "vda5050": "agvPosition", "iso21423": "pose.locationPoint"}
"""The key that has the position, by language."""


class UnitMoves(NamedTuple):
    """Moves in a row that are too fast by the same factor, up to the newest sighting."""

    t_s: float
    """Time of that sighting."""
    factor: float
    unit: str
    dx_m: float
    dy_m: float
    """The last of them."""
    gap_s: float
    """How long it took."""
    speed: str
    """What the robot says of its speed, in words."""
    moves: int
    """How many they are."""

    @property
    def shows_unit(self) -> bool:
        return self.moves >= LEAST_MOVES

    def continues(self, earlier: "UnitMoves", before: Sighting) -> bool:
        """Whether it is the next move after the earlier ones, in about their direction."""
        is_next = earlier.t_s == before.t_s and earlier.factor == self.factor
        return is_next and self.dx_m * earlier.dx_m + self.dy_m * earlier.dy_m > 0.0

    def oddity(self, language: str) -> Oddity:
        """What a person is shown of it."""
        moved = f"{hypot(self.dx_m, self.dy_m):.0f} m further after {self.gap_s:.1f} s"
        reading = (
            f"metres; positions move {self.factor:g} times faster than {self.speed}: are they {self.unit}? Send metres"
        )
        return Oddity(POSITION_IN_OTHER_UNIT, LOCATIONS.get(language, ""), moved, reading)


def unit_moves(
    known: UnitMoves | None, before: Sighting | None, now: Sighting, max_speed_mps: float | None
) -> UnitMoves | None:
    """The moves in a row up to `now`, as it was sent. None if the last one fits no other unit.

    A robot that sends no speed is taken to drive as fast as it can.
    """
    is_sent = now.linear_mps is not None
    speed_mps = abs(now.linear_mps or 0.0) if is_sent else max_speed_mps or 0.0
    gap_s = now.t_s - before.t_s if before and before.floor == now.floor else 0.0
    if before is None or not 0.0 < gap_s <= OBSERVABLE_S or speed_mps <= LEAST_MPS:
        return None
    dx_m, dy_m = now.x_m - before.x_m, now.y_m - before.y_m
    moved_mps = hypot(dx_m, dy_m) / gap_s
    for unit, factor in UNITS:
        if are_within(moved_mps, factor * speed_mps, NEAR):
            speed = "the speed that it sends" if is_sent else "its greatest speed"
            move = UnitMoves(now.t_s, factor, unit, dx_m, dy_m, gap_s, speed, 1)
            return move._replace(moves=known.moves + 1) if known and move.continues(known, before) else move
    return None
