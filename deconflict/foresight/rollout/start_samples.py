"""What robots may do otherwise than they say, in the same few samples at every look: evenly spread, and no chance."""

from zlib import crc32

import numpy as np
from scipy.special import ndtri

from ingest.batch import Floats, Ints

SAMPLES = 8
PACE_SD = 0.05
"""Standard deviation of a robot's speed, in parts of what its forecast says."""
PACE, START = 1, 2
"""What is drawn."""


def key_of(uuid: str) -> int:
    """A number that is the same for a robot wherever it is known."""
    return crc32(uuid.encode()) & 0xFFFFFF


def quantiles(key: Ints, drawn: int) -> Floats:
    """(SAMPLES, n) parts of a distribution: for each robot of `key` (n,) one in each eighth, in an order of its own."""
    mixed = (key + 0x9E37 * drawn) * 0x85EBCA
    mixed ^= mixed >> 13
    odd, first = 2 * (mixed % (SAMPLES // 2)) + 1, (mixed >> 5) % SAMPLES
    place = (np.arange(SAMPLES)[:, None] * odd + first) % SAMPLES
    part: Floats = (place + 0.5) / SAMPLES
    return part


def paces(key: Ints) -> Floats:
    """(SAMPLES, n) speeds of robots, in parts of what their forecasts say."""
    pace: Floats = 1.0 + PACE_SD * ndtri(quantiles(key, PACE))
    return pace
