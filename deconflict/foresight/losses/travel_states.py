"""What robots say of themselves: whether they are on their way, and whether their forecasts show where they go."""

from functools import lru_cache
from math import hypot
from typing import NamedTuple

import numba
import numpy as np

from deconflict.foresight.interactions.recent_reports import EXPLAINS_STANDING
from deconflict.foresight.losses.losing import GOES, HALTS, NO_WAY, ORDER, PATH, RESTS, VELOCITY, WAITS
from deconflict.foresight.motion_assumptions import MOVES_MPS
from ingest.batch import Basis, Batch, Bools, Floats, Ints
from ingest.kernels import BOOLS, FLOAT, INTS, inner, kernel

_PLAN_OF = {Basis.VELOCITY: VELOCITY, Basis.ORDER: ORDER, Basis.PATH: PATH}
PLANS = np.array([_PLAN_OF.get(basis, NO_WAY) for basis in Basis])
"""By basis, what a forecast tells. A forecast towards a destination leads straight there, through racks and walls: it
tells no way."""
NAVIGATING, WAITING = "navigating", "waitingExternalEvent"


class TravelStates(NamedTuple):
    """What n robots say of themselves. Arrays are (n,)."""

    goes: Ints
    """`RESTS`, `WAITS`, `GOES` or `HALTS`."""
    plans: Ints
    """What the forecast tells: `NO_WAY`, `VELOCITY`, `ORDER` or `PATH`."""
    has_destination: Bools


def travel_states(batch: Batch, track: Floats, names_destinations: Bools, reports_paths: Bools) -> TravelStates:
    """What the n robots of a batch say of themselves.

    `track` (n, k, 4) are x_m, y_m, yaw_rad and floor of their forecasts for each second, and `names_destinations` (n,)
    is whether they have ever named a destination: those that have name one as long as they are on their way. In the
    same way, robots that have ever reported a path (`reports_paths`) report one as long as they can drive.
    """
    has_destination = np.diff(batch.destinations.start) > 0
    goes, plans = np.array(list(map(_of_state, batch.states)), np.int64), PLANS[batch.basis]
    stands = batch.basis == Basis.STATIONARY
    _correct(goes, plans, stands, has_destination, names_destinations, reports_paths, track)
    return TravelStates(goes, plans, has_destination)


@inner
def _leads_nowhere(track: Floats) -> bool:
    """Whether a forecast (k, 4) stays where it begins, or changes the floor."""
    end_m = hypot(track[-1, 0] - track[0, 0], track[-1, 1] - track[0, 1])
    return end_m < MOVES_MPS or bool((track[:, 3] != track[0, 3]).any())


@kernel(numba.void(*[INTS] * 2, *[BOOLS] * 4, numba.types.Array(FLOAT, 3, "A")))
def _correct(
    goes: Ints,
    plans: Ints,
    stands: Bools,
    has_destination: Bools,
    names_destinations: Bools,
    reports_paths: Bools,
    track: Floats,
) -> None:
    """Change what n robots say of themselves where their destinations and forecasts tell more."""
    for row in range(len(goes)):
        navigates = goes[row] == GOES
        if goes[row] == WAITS and has_destination[row]:
            goes[row] = GOES
        elif goes[row] == WAITS and names_destinations[row]:
            goes[row] = HALTS
        if navigates and reports_paths[row] and stands[row]:
            goes[row] = RESTS
        if goes[row] == GOES and plans[row] >= ORDER and _leads_nowhere(track[row]):
            goes[row] = WAITS


@lru_cache(maxsize=64)
def _of_state(state: str) -> int:
    if state == NAVIGATING:
        return GOES
    return WAITS if state not in EXPLAINS_STANDING and state == WAITING else RESTS
