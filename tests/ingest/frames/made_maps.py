"""Maps of a vendor's plane that tests know the answer to."""

from math import cos, sin

import numpy as np
from hypothesis import strategies as st

from ingest.batch import Floats
from ingest.frames.transforms import Affine

HALL = np.array([[0.0, 0.0], [40.0, 1.0], [38.0, 25.0], [2.0, 24.0], [19.0, 11.0], [30.0, 6.0]])
"""Six places in a hall, metres, none of them nearly on a line with two others."""


def similarity(turn_rad: float, scale: float, shift: tuple[float, float], *, mirrored: bool = False) -> Affine:
    c, s = scale * cos(turn_rad), scale * sin(turn_rad)
    flip = np.diag([1.0, -1.0 if mirrored else 1.0])
    return Affine(np.array([[c, -s], [s, c]]) @ flip, np.array(shift))


def sheared(turn_rad: float, along_x: float, along_y: float, shear: float) -> Affine:
    turned = similarity(turn_rad, 1.0, (12.0, -7.0))
    return Affine(turned.matrix @ np.array([[along_x, shear], [0.0, along_y]]), turned.shift)


def jolts(points: int, size_m: float, seed: int) -> Floats:
    return np.random.default_rng(seed).uniform(-size_m, size_m, (points, 2))


turns = st.floats(-3.1, 3.1)
shifts = st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4))
scales = st.sampled_from([0.001, 0.05, 0.98, 1.0, 39.37, 1000.0])
similarities = st.builds(similarity, turns, scales, shifts, mirrored=st.booleans())
affines = st.builds(sheared, turns, st.floats(0.8, 1.2), st.floats(0.8, 1.2), st.floats(-0.2, 0.2))
seeds = st.integers(0, 10_000)
