"""Poses that a robot which drives sends again and again, since its localisation is slower than its messages.

Such a pose is as old as its first message, and the next one shows how far the robot drove since that. Robots that stand
repeat their poses too. So a pose is held only of a robot that was seen to hold poses while it drove steadily.
"""

from dataclasses import dataclass
from math import hypot, inf, isnan

from msgspec.structs import replace

from ingest.fleet.prediction.forecast_model import Sighting
from ingest.frames.assumed_motion import DRIVES_MPS

LATER, LONGEST_S = 1.3, 5.0
"""A pose may be held so many times as long as the last ones, and at most so long. Then the robot stands."""
STEADY = 1.4
"""A robot that drives steadily is as fast from pose to pose as before, or as it says, but for this factor."""
LAST = 4
"""Poses that were held, of which the longest counts."""
FREE = 5
"""After so many new poses in a row that were not held, the robot holds none."""


@dataclass(slots=True)
class HeldPoses:
    """How long one robot holds its poses."""

    lasts_s: tuple[float, ...] = ()
    """For how long the last ones were held while it drove; empty if it holds none."""
    _mps: float = 0.0
    """How fast it moved from the last one that was held to the pose after it."""
    _free: int = 0
    """New poses since then that were not held."""

    def as_of_pose(self, last: Sighting | None, now: Sighting) -> Sighting:
        """`now`, which follows `last`, as of when its pose came first if that is held."""
        if last is None or last.floor != now.floor or now.t_s <= last.t_s:
            return now
        if not is_repeated(last, now):
            self._note_move(last, now)
            return now
        posed_s = last.t_s if isnan(last.posed_s) else last.posed_s
        repeated = replace(now, posed_s=posed_s, repeated_s=now.t_s)
        was_held = last.is_driving and last.t_s == posed_s
        is_held = was_held and now.t_s - posed_s <= self._longest_s
        return replace(repeated, t_s=posed_s) if is_held else repeated

    def begun(self, before: Sighting | None, now: Sighting) -> Sighting | None:
        """The sighting `before`, as of when the robot may have set out from there for `now`."""
        if before is None or isnan(before.posed_s) or not self.lasts_s or is_repeated(before, now):
            return before
        begun_s = max(before.posed_s, before.repeated_s - max(self.lasts_s))
        return replace(before, t_s=min(before.t_s, begun_s))

    @property
    def _longest_s(self) -> float:
        return min(LATER * max(self.lasts_s, default=-inf), LONGEST_S)

    def _note_move(self, last: Sighting, now: Sighting) -> None:
        if isnan(last.posed_s):
            self._free += last.is_driving
            if self._free >= FREE:
                self.lasts_s = ()
            return
        moved_mps = hypot(now.x_m - last.x_m, now.y_m - last.y_m) / (now.t_s - last.posed_s)
        is_steady = any(
            moved_mps < STEADY * mps < STEADY**2 * moved_mps for mps in (self._mps, abs(now.linear_mps or 0))
        )
        self._mps, self._free = moved_mps, 0
        if is_steady and moved_mps > DRIVES_MPS:
            self.lasts_s = (*self.lasts_s[1 - LAST :], last.repeated_s - last.posed_s)


def is_repeated(last: Sighting, now: Sighting) -> bool:
    """Whether the pose is the one before, to the last digit, of a robot that does not say that it stands."""
    is_same = (last.x_m, last.y_m, last.state) == (now.x_m, now.y_m, now.state)
    says_it_stands = now.linear_mps is not None and abs(now.linear_mps) <= DRIVES_MPS
    return is_same and not says_it_stands and (isnan(now.yaw_rad) or now.yaw_rad == last.yaw_rad)
