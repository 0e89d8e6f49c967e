"""What is kept of each robot while it may lose time, and what was lost."""

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

RESTS, WAITS, GOES, HALTS = range(4)
"""What a robot says of itself: it is not on its way, it waits, it is on its way, or it waits and does not name its
destination any more."""
NO_WAY, VELOCITY, ORDER, PATH = range(4)
"""What the forecast of a robot tells: not where it goes, only whither it drives now, its way, or its way and times."""
STANDS_M = 0.05
"""A robot that came less far stands."""
APART_S = 6.0
"""Reports further apart do not tell how much time was lost."""

LOSING = np.dtype(
    [
        ("known", np.bool_),  # the robot has a report
        ("heard_s", np.float64),  # time of its last report
        ("loses", np.bool_),  # it lost time until its last report
        ("blocker", np.int64),  # slot of the robot because of which; NOBODY if none is known
        ("seen_s", np.float64),  # when the blocker was last in its way
        ("is_on_way", np.bool_),  # the blocker was on its way, and did not only cross it
        ("went", np.int64),  # what the robot said of itself at its last report
        ("references", np.int64),  # number of kept forecasts from before it began to lose time
        ("usual_mps", np.float64),  # speed at which it drives if nothing is in its way
        ("pending_s", np.float64),  # lost since `pending_from_s`, before a blocker was seen
        ("pending_from_s", np.float64),
        ("pending_over_s", np.float64),  # the same against the usual time
        ("lost_at_s", np.float64),  # when it last lost time
        ("is_planned", np.bool_),  # it said itself which way it goes
        ("stood_s", np.float64),  # since when it stands on its way; 0 if it does not
        ("stood_x_m", np.float64),  # where it stands
        ("stood_y_m", np.float64),
        ("booked_s", np.float64),  # until when what it lost is because of another robot
    ],
    align=True,
)
LOST = np.dtype(
    [
        ("row", np.int64),  # of the reports
        ("blocker", np.int64),  # slot; NOBODY if no robot was in the way
        ("from_s", np.float64),
        ("until_s", np.float64),
        ("lost_s", np.float64),
        ("over_s", np.float64),  # what it needed longer than usual
        ("is_on_way", np.bool_),  # the blocker was on the way, and did not only cross it
        ("is_mutual", np.bool_),  # the blocker stands for the robot, as that does for it
    ],
    align=True,
)
Losing = NDArray[Any]
"""Of `LOSING`."""
LostTimes = NDArray[Any]
"""Of `LOST`."""
LOSING_TYPE, LOST_TYPE = (numba.from_dtype(dtype)[::1] for dtype in (LOSING, LOST))
"""The types of both in kernels."""
