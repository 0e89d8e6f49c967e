"""Robots that are heard where they can't have driven to: they were moved by hand, or their localisation jumped.

Only a robot that stood, or said nothing for a while, is moved so. One that drives and jumps is judged as before: its
positions may be in another unit, or two senders may share its UUID.
"""

from typing import NamedTuple

from ingest.fleet.prediction.forecast_model import Sighting
from ingest.fleet.prediction.held_poses import LONGEST_S
from ingest.fleet.prediction.path_forecast import PLAUSIBLE_SPEED_MPS

SLACK_M = 2.0
"""A position may change by this without a move by hand: by noise and corrections, and by a start before the report."""
FASTER = 1.5
"""A robot may be so many times faster than it says."""
STARTS_MPS2 = 2.0
"""No robot that stands starts more quickly."""
SILENT_S = 5.0
"""A robot that drove may have been moved if it said nothing for longer."""


class HandMove(NamedTuple):
    """A move that a robot can't have driven. These are also the names in JSON."""

    at_s: float
    """When the robot was first heard at the other place."""
    distance_m: float
    took_s: float
    """Time between the two poses."""
    times: int
    """How many such moves there were, with this one."""

    @property
    def sentence(self) -> str:
        took = f"in {self.took_s:.0f} s" if self.took_s >= 1.0 else "at once"
        return f"was moved by hand or its localisation jumped: {self.distance_m:.1f} m {took}"


def is_out_of_reach(before: Sighting, now: Sighting, doubt_m: float, max_speed_mps: float | None) -> bool:
    """Whether a robot that stood or was silent can't have driven from one sighting to the other, which is later. A
    change of floor is never out of reach: there are lifts. A pose that was sent again a few times may be as old as the
    first of them."""
    is_of_late = before.t_s - before.posed_s <= LONGEST_S
    took_s = now.t_s - (before.posed_s if is_of_late else before.t_s)
    stood = not before.is_driving and before.linear_mps is not None and not before.same_place_s
    if before.floor != now.floor or not (stood or took_s > SILENT_S):
        return False
    fastest_mps = FASTER * (max_speed_mps or PLAUSIBLE_SPEED_MPS)
    starts_s = fastest_mps / STARTS_MPS2 if stood else 0.0
    in_start_s = took_s if took_s < starts_s else starts_s
    reach_m = SLACK_M + doubt_m + STARTS_MPS2 * in_start_s**2 / 2 + fastest_mps * (took_s - in_start_s)
    return (now.x_m - before.x_m) ** 2 + (now.y_m - before.y_m) ** 2 > reach_m**2
