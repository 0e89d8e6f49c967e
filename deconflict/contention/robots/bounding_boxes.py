"""Bounding boxes: few numbers decide which shapes need not be compared."""

import numpy as np

from ingest.batch import Floats, Ints
from ingest.kernels import INT_MATRIX, INTS, READ_MATRIX, inner, kernel

ROUNDING_M = 1e-6
"""Margin for rounding errors."""


@inner
def write_box(box: Floats, west: float, south: float, east: float, north: float) -> None:
    """Set a box (4,). An assignment of all four at once would compile texts of errors into the kernel, for seconds."""
    box[0], box[1], box[2], box[3] = west, south, east, north


def touching_boxes(boxes: Floats, others: Floats) -> Ints:
    """(k, 2) rows of `boxes` (n, 4) and `others` (m, 4) that touch, by the first; each is west, south, east, north."""
    return _touching(boxes, others, np.argsort(others[:, 0]))


@kernel(INT_MATRIX(READ_MATRIX, READ_MATRIX, INTS))
def _touching(boxes: Floats, others: Floats, order: Ints) -> Ints:
    """The same, with the order of `others` from west to east."""
    ranked, west_m = others[order], others[order, 0]
    widest_m = (others[:, 2] - others[:, 0]).max() if len(others) else 0.0
    found, k = np.empty((len(boxes), 2), np.int64), 0
    for row in range(len(boxes)):
        west, south, east, north = boxes[row]
        for at in range(np.searchsorted(west_m, west - widest_m), len(west_m)):
            if west_m[at] > east:
                break
            if ranked[at, 2] >= west and ranked[at, 1] <= north and ranked[at, 3] >= south:
                if k == len(found):
                    found = np.concatenate((found, np.empty_like(found)))
                found[k, 0], found[k, 1] = row, order[at]
                k += 1
    return found[:k].copy()


def enlarged(boxes_m: Floats, by_m: Floats) -> Floats:
    """(n, 4) boxes around all that is within `by_m` (n,) of boxes."""
    return boxes_m + (by_m + ROUNDING_M)[:, None] * _OUTWARDS


_OUTWARDS: Floats = np.array([-1.0, -1.0, 1.0, 1.0])
