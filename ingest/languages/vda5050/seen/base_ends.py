"""What happens at the end of a robot's base: usually it is extended while the robot still drives."""

from math import hypot

import msgspec

from ingest.frames.assumed_motion import DRIVES_MPS
from ingest.languages.model import MAX_SPEED_MPS
from ingest.languages.vda5050.vda_messages import StateMessage, Velocity2d

FADES = 0.9
"""Each base end makes those before count less by this factor."""
WITH_HORIZON, WITHOUT_HORIZON = (2.0, 1.0), (0.5, 1.5)
"""Extensions in time, and stops, that are assumed of a robot before any is seen."""


class BaseEnds(msgspec.Struct, frozen=True, gc=False):
    """How often the base of one robot was extended in time, and how often it had to stop."""

    extended: float = 0.0
    stopped: float = 0.0

    def after(self, *, in_time: bool) -> "BaseEnds":
        """With one more extension of a base, in time or while the robot stood."""
        return BaseEnds(self.extended * FADES + in_time, self.stopped * FADES + (not in_time))

    def are_extended(self, *, has_horizon: bool) -> bool:
        """Whether the base is usually extended before the robot has to stop."""
        extended, stopped = WITH_HORIZON if has_horizon else WITHOUT_HORIZON
        return self.extended + extended > self.stopped + stopped


def is_under_way(state: StateMessage, velocity: Velocity2d | None) -> bool:
    """Whether a robot drives by its newest messages."""
    return bool(state.driving) or speed_mps(velocity) > DRIVES_MPS


def speed_mps(velocity: Velocity2d | None) -> float:
    """The reported speed; 0 if none was sent, or one that no robot has."""
    reported_mps = hypot(velocity.vx or 0.0, velocity.vy or 0.0) if velocity else 0.0
    return reported_mps if reported_mps <= MAX_SPEED_MPS else 0.0
