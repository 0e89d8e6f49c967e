"""What robots say of themselves: whether they are on their way, and whether their forecasts show where they go."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from deconflict.foresight.interactions.report_progress import EXPLAINS_STANDING
from deconflict.foresight.losses.loss_kernels import GOES, NO_WAY, ORDER, PATH, RESTS, VELOCITY, WAITS
from deconflict.foresight.motion_assumptions import MOVES_MPS
from ingest.batch import Basis, Batch, Bools, Floats, Ints

_PLAN_OF = {Basis.VELOCITY: VELOCITY, Basis.ORDER: ORDER, Basis.PATH: PATH}
PLANS = np.array([_PLAN_OF.get(basis, NO_WAY) for basis in Basis])
"""By basis, what a forecast tells. A forecast towards a destination leads straight there, through racks and walls: it
tells no way."""
NAVIGATING, WAITING = "navigating", "waitingExternalEvent"


class TravelStates(NamedTuple):
    """What n robots say of themselves. Arrays are (n,)."""

    goes: Ints
    """`RESTS`, `WAITS` or `GOES`."""
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
    goes = np.array(list(map(_of_state, batch.states)), np.int64)
    navigates = goes == GOES
    goes[(goes == WAITS) & has_destination] = GOES
    goes[(goes == WAITS) & names_destinations] = RESTS
    plans = PLANS[batch.basis]
    goes[(goes == GOES) & reports_paths & (batch.basis == Basis.STATIONARY) & navigates] = RESTS
    stays = np.hypot(*(track[:, -1, :2] - track[:, 0, :2]).T) < MOVES_MPS
    changes_floor = (track[:, :, 3] != track[:, :1, 3]).any(axis=1)
    goes[(goes == GOES) & (plans >= ORDER) & (stays | changes_floor)] = WAITS
    return TravelStates(goes, plans, has_destination)


@lru_cache(maxsize=64)
def _of_state(state: str) -> int:
    if state == NAVIGATING:
        return GOES
    return WAITS if state not in EXPLAINS_STANDING and state == WAITING else RESTS
