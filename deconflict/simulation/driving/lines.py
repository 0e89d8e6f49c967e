"""What a robot looks at before it comes into a crossing: who is in it, and whether there is room beyond.

It waits at the line for somebody who stands in the crossing, or drives across it, and while somebody stands where it
would leave it. Two that come to their lines at once do not see each other there.
"""

import numpy as np

from deconflict.simulation.driving.crossings import Crossings
from deconflict.simulation.driving.protection import NOBODY, Bools, Traffic, centres
from deconflict.simulation.layout import Layout
from ingest.seam import Floats, Ints

BOX_M = 1.7
"""Half of the square in which others are in the crossing."""
EXIT_M, NEAR_EXIT_M = 0.7, 1.1
"""How far beyond the crossing a robot looks for room, and how near to there nobody may stand."""
LOOKS_FROM_M, LOOKS_TO_M = 1.4, -0.05
"""A robot looks from so far before its line."""
STANDING_MPS = 0.15
ALONG_COS = 0.8
"""Who drives along, either way, is not in the way."""
LONGEST_S = 12.0
"""A robot that has stood at its line for so long comes in."""


class Lines:
    """Where robots wait before crossings."""

    def __init__(self, crossings: Crossings, layout: Layout, robots: int) -> None:
        self._crossings, self._places = crossings, np.array(layout.places)
        self._passed_m = np.full(robots, -np.inf)
        """(n,) the line that each has waited at for long enough."""

    def look(self, seen: Traffic, driving: Bools, waited_s: Floats) -> tuple[Floats, Ints]:
        """(n,) how far each may go, inf where its crossing is clear, and (n,) for whom it waits."""
        line_m, waits_for = np.full(len(driving), np.inf), np.full(len(driving), NOBODY)
        to_line_m = self._crossings.enter_m - seen.progress_m
        asks = driving & (to_line_m <= LOOKS_FROM_M) & (to_line_m >= LOOKS_TO_M)
        asks &= self._passed_m != self._crossings.enter_m
        rows = np.flatnonzero(asks)
        if not len(rows):
            return line_m, waits_for
        here = centres(seen, np.arange(len(driving)), seen.progress_m)
        for robot in rows.tolist():
            other = self._in_way(seen, here, robot)
            if other == NOBODY:
                continue
            if waited_s[robot] > LONGEST_S:
                self._passed_m[robot] = self._crossings.enter_m[robot]
                continue
            line_m[robot], waits_for[robot] = max(to_line_m[robot], 0.0), other
        return line_m, waits_for

    def leave(self, robot: int) -> None:
        """A robot sets out on another drive."""
        self._passed_m[robot] = -np.inf

    def _in_way(self, seen: Traffic, here: Floats, robot: int) -> int:
        passage = self._crossings.next(robot)
        x, y = self._places[passage.node]
        apart_m = np.maximum(np.abs(here[0] - x), np.abs(here[1] - y))
        speed_mps = np.abs(seen.speed_mps)
        standing = speed_mps < STANDING_MPS
        along = np.abs(np.cos(here[2] - here[2, robot])) > ALONG_COS
        others = seen.fleet != seen.fleet[robot]
        inside = (apart_m < BOX_M) & others & (standing | ~along)
        out = seen.tracks.poses(np.array(robot), np.array(passage.leave_m + EXIT_M))
        beyond = standing & (np.hypot(here[0] - out[0], here[1] - out[1]) < NEAR_EXIT_M)
        in_way = (inside | beyond) & (seen.floor == seen.floor[robot])
        in_way[robot] = False
        found = np.flatnonzero(in_way)
        return int(found[np.argmin(apart_m[found])]) if len(found) else NOBODY
