"""Encounters of envelopes as a simulated floor has them, to compare advisories with."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from deconflict.contention.robots.lookahead import corners
from ingest.batch import Floats, Ints

SAME_ENCOUNTER_S = 1.0
"""If a pair is within the clearance again after at most this time, it is the same encounter."""


@dataclass(slots=True)
class TrueEncounter:
    """Two envelopes within the clearance. Times are the world's. The resolution is that of the steps."""

    robots: tuple[int, int]
    start_s: float
    last_s: float
    """When they were last within the clearance."""
    separation_m: float
    """Smallest separation; 0 if they overlapped."""


def near_pairs(envelopes: Floats, floors: Ints, clearance_m: float) -> Iterator[tuple[tuple[int, int], float]]:
    """Pairs of rows (a < b) on one floor within the clearance, with their separation; `envelopes` is (n, 5)."""
    shapes = np.asarray(shapely.polygons(corners(*envelopes.T)))
    pairs = shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=clearance_m).T
    for a, b in pairs[(pairs[:, 0] < pairs[:, 1]) & (floors[pairs[:, 0]] == floors[pairs[:, 1]])]:
        yield (int(a), int(b)), float(shapely.distance(shapes[a], shapes[b]))
