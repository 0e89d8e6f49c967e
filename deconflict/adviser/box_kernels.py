"""Which rectangles touch."""

import numba
import numpy as np

from ingest.batch import Bools, Floats
from ingest.kernels import kernel

_COLUMN = numba.types.Array(numba.float64, 3, "A", readonly=True)
_BOXES = numba.types.Tuple([_COLUMN] * 6)  # type: ignore[no-untyped-call]


@kernel(numba.boolean[:, :, ::1](_BOXES, _BOXES))
def touching(boxes: tuple[Floats, ...], others: tuple[Floats, ...]) -> Bools:
    """(n, m, k) whether rectangles touch, by their four axes. Comparisons with nan are false.

    Each has six columns (n, m, k): x and y of the centre, cosine and sine of the direction, half of the length and of
    the width, in metres.
    """
    x_m, y_m, cos, sin, half_length_m, half_width_m = boxes
    other_x_m, other_y_m, other_cos, other_sin, other_half_length_m, other_half_width_m = others
    found = np.zeros(x_m.shape, np.bool_)
    for at in np.ndindex(x_m.shape):
        dx_m, dy_m = other_x_m[at] - x_m[at], other_y_m[at] - y_m[at]
        c = abs(cos[at] * other_cos[at] + sin[at] * other_sin[at])
        s = abs(cos[at] * other_sin[at] - sin[at] * other_cos[at])
        length_m, width_m = half_length_m[at], half_width_m[at]
        other_length_m, other_width_m = other_half_length_m[at], other_half_width_m[at]
        found[at] = (
            abs(dx_m * cos[at] + dy_m * sin[at]) <= length_m + other_length_m * c + other_width_m * s
            and abs(dy_m * cos[at] - dx_m * sin[at]) <= width_m + other_length_m * s + other_width_m * c
            and abs(dx_m * other_cos[at] + dy_m * other_sin[at]) <= other_length_m + length_m * c + width_m * s
            and abs(dy_m * other_cos[at] - dx_m * other_sin[at]) <= other_width_m + length_m * s + width_m * c
        )
    return found
