"""The lines along which robots drive in a known frame, and which of them a driven place of another frame is on."""

from dataclasses import dataclass

import numpy as np

from ingest.batch import Bools, Floats, Ints
from ingest.frames.driven.driven_places import DrivenPlaces

CELL_M = 0.5
TURN_M = 2.0
"""A unit of heading counts like this distance: places of another direction are on another line."""
SMOOTH_M = 0.6
"""A line is the mean of its places within this."""
BEYOND_M = 0.8
"""A place farther than this beyond the end of a line is not on it."""
MOST_WORTH = 2.0
"""A place counts by the square root of its metres, up to this."""


@dataclass(frozen=True, slots=True, eq=False)
class OnLines:
    """For n places: the line that each is on, if any."""

    rows: Ints
    """(m,) the places that are on a line."""
    normals: Floats
    """(m, 2) to the left of the place's own direction."""
    along: Floats
    """(m, 2) the place's own direction, as the line has it."""
    off_m: Floats
    """(m,) how far to the left of the line the place is."""
    against: Bools
    """(m,) whether the line is driven only in the other direction."""


class KnownLines:
    """Lines of driven places."""

    def __init__(self, known: DrivenPlaces) -> None:
        from scipy.spatial import cKDTree  # noqa: PLC0415 - only proposals need it

        coarse = known.coarser(CELL_M)
        lifted = _lifted(coarse.points_m, coarse.headings)
        tree = cKDTree(lifted)
        pairs = tree.query_pairs(SMOOTH_M, output_type="ndarray")
        weight = np.sqrt(coarse.metres)
        sums = np.column_stack([np.ones(len(coarse)), coarse.points_m, coarse.headings]) * weight[:, None]
        total = sums.copy()
        for a, b in ((0, 1), (1, 0)):
            for column in range(sums.shape[1]):
                total[:, column] += np.bincount(pairs[:, a], sums[pairs[:, b], column], len(coarse))
        self.places = DrivenPlaces.of_sums(total)
        self._tree = cKDTree(_lifted(self.places.points_m, self.places.headings))

    def of(self, points_m: Floats, headings: Floats, within_m: float) -> OnLines:
        """The lines of places (n, 2) with these headings (n, 2): one in the same direction, else one against it."""
        row, is_near = self._nearest(points_m, headings, within_m)
        back, is_back = self._nearest(points_m, -headings, within_m)
        against = ~is_near & is_back
        line = np.where(against, back, row)
        found = np.flatnonzero(is_near | against)
        line, against = line[found], against[found]
        along = self.places.headings[line] * np.where(against, -1.0, 1.0)[:, None]
        normals = np.column_stack([-along[:, 1], along[:, 0]])
        off_m = np.einsum("ij,ij->i", normals, points_m[found] - self.places.points_m[line])
        return OnLines(found, normals, along, off_m, against)

    def _nearest(self, points_m: Floats, headings: Floats, within_m: float) -> tuple[Ints, Bools]:
        apart, row = self._tree.query(_lifted(points_m, headings), distance_upper_bound=within_m)
        found = np.isfinite(apart)
        row = np.where(found, row, 0)
        ahead_m = np.einsum("ij,ij->i", self.places.headings[row], points_m - self.places.points_m[row])
        return row, found & (np.abs(ahead_m) < BEYOND_M)


def _lifted(points_m: Floats, headings: Floats) -> Floats:
    return np.hstack([points_m, TURN_M * headings])


def worth_of(places: DrivenPlaces) -> Floats:
    """(n,) what each place counts: where most is driven counts little more than where robots drive now and then."""
    return np.minimum(np.sqrt(places.metres), MOST_WORTH)
