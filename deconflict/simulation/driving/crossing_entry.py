"""The check of a robot before it enters a crossing: who is in it, and whether there is room beyond.

It waits at the line for a robot of another fleet that stands in the crossing or drives across it, and while a robot
stands where it would leave the crossing. Two robots that reach their lines at the same time do not see each other.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from deconflict.simulation.driving.crossings import Crossings
from deconflict.simulation.driving.protection import FLOOR_M, NOBODY, Traffic, centres
from deconflict.simulation.floor_layout import Place
from ingest.batch import Bools, Floats, Ints

BOX_M = 1.9
"""Half side of the square that counts as the crossing."""
EXIT_M, NEAR_EXIT_M = 0.7, 1.1
"""How far beyond the crossing a robot needs room, and the radius there in which nobody may stand."""
LOOKS_FROM_M, LOOKS_TO_M = 1.4, -0.05
"""Range of the distance to its line in which a robot checks."""
AROUND_M = 5.0
"""Robots in a crossing, or where another leaves it, are within this distance of its middle."""
STANDING_MPS = 0.15
ALONG_COS = 0.8
"""A robot that drives in the same or the opposite direction is not in the way."""
LONGEST_S = 12.0
"""A robot that has waited at its line for this long enters."""


class CrossingEntry:
    """The lines at which robots wait before crossings."""

    def __init__(self, crossings: Crossings, places: Sequence[Place], robots: int) -> None:
        """`places` are the middles of the crossings, by the number of their node."""
        self._crossings, self._places = crossings, np.array(places).reshape(-1, 2)
        self._passed_m = np.full(robots, -np.inf)
        """(n,) progress of the line at which each has waited for long enough."""

    def limits(self, seen: Traffic, driving: Bools, waited_s: Floats) -> tuple[Floats, Ints]:
        """(n,) how far each may drive, inf if its crossing is clear, and (n,) for whom it waits."""
        line_m, waits_for = np.full(len(driving), np.inf), np.full(len(driving), NOBODY)
        to_line_m = self._crossings.enter_m - seen.progress_m
        asks = driving & (to_line_m <= LOOKS_FROM_M) & (to_line_m >= LOOKS_TO_M)
        asks &= self._passed_m != self._crossings.enter_m
        rows = np.flatnonzero(asks)
        if not len(rows):
            return line_m, waits_for
        who, whom = self._in_way(seen, rows)
        tired = waited_s[who] > LONGEST_S
        self._passed_m[who[tired]] = self._crossings.enter_m[who[tired]]
        waits_for[who[~tired]] = whom[~tired]
        line_m[who[~tired]] = np.maximum(to_line_m[who[~tired]], 0.0)
        return line_m, waits_for

    def reset(self, robot: int) -> None:
        """Forget the line of a robot that starts another drive."""
        self._passed_m[robot] = -np.inf

    def _in_way(self, seen: Traffic, rows: Ints) -> tuple[Ints, Ints]:
        """(p,) robots at their lines, and (p,) the others for which they wait."""
        ahead = [self._crossings.ahead[robot][0] for robot in rows.tolist()]
        middle = self._places[[passage.node for passage in ahead]].T
        out = seen.tracks.poses(rows, np.array([passage.leave_m for passage in ahead]) + EXIT_M)[:2]
        here = centres(seen, np.arange(len(seen.floor)), seen.progress_m)
        points = np.column_stack([here[0] + FLOOR_M * seen.floor, here[1]])
        asked = np.column_stack([middle[0] + FLOOR_M * seen.floor[rows], middle[1]])
        found = cKDTree(asked).query_ball_tree(cKDTree(points), AROUND_M)
        which = np.repeat(np.arange(len(rows)), [len(near) for near in found])
        whom = np.array([other for near in found for other in near], np.int64)
        who = rows[which]
        standing = np.abs(seen.speed_mps[whom]) < STANDING_MPS
        along = np.abs(np.cos(here[2, whom] - here[2, who])) > ALONG_COS
        dx_m, dy_m = here[:2, whom] - middle[:, which]
        inside = (np.maximum(np.abs(dx_m), np.abs(dy_m)) < BOX_M) & (standing | ~along)
        beyond = standing & (np.hypot(*(here[:2, whom] - out[:, which])) < NEAR_EXIT_M)
        in_way = ((inside & (seen.fleet[whom] != seen.fleet[who])) | beyond) & (who != whom)
        return who[in_way], whom[in_way]
