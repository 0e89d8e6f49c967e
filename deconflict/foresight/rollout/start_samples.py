"""How robots may depart from their forecasts: a few samples, evenly spread and not random, the same at every look."""

from statistics import NormalDist
from zlib import crc32

import numpy as np

from ingest.batch import Floats, Ints

SAMPLES = 8
PACE_SD = 0.05
"""Standard deviation of a robot's speed, as a share of its forecast speed."""
PACE, START = 1, 2
"""The quantities that are sampled."""


def key_of(uuid: str) -> int:
    """A number of 24 bits that is the same for a robot in every process."""
    return crc32(uuid.encode()) & 0xFFFFFF


def quantiles(key: Ints, quantity: int) -> Floats:
    """(SAMPLES, n) parts of a distribution: one in each eighth for each robot of `key` (n,), in an order of its own."""
    return (_eighths(key, quantity) + 0.5) / SAMPLES


def paces(key: Ints) -> Floats:
    """(SAMPLES, n) speeds of robots, as shares of their forecast speeds. They are normally distributed."""
    return _PACES[_eighths(key, PACE)]


_PACES: Floats = np.array([NormalDist(1.0, PACE_SD).inv_cdf((eighth + 0.5) / SAMPLES) for eighth in range(SAMPLES)])


def _eighths(key: Ints, quantity: int) -> Ints:
    """(SAMPLES, n) all numbers below SAMPLES for each robot of `key` (n,), in an order of its own."""
    mixed = (key + 0x9E37 * quantity) * 0x85EBCA
    mixed ^= mixed >> 13
    odd, first = 2 * (mixed % (SAMPLES // 2)) + 1, (mixed >> 5) % SAMPLES
    return (np.arange(SAMPLES)[:, None] * odd + first) % SAMPLES
