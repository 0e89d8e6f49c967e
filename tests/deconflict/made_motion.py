"""Random motions of one rectangle about another, and their distances by the oracle's means."""

import numpy as np
from numpy.random import Generator

from deconflict.relative import Relative
from ingest.seam import Floats
from tests.oracle import rectangle_distance


def motions(rng: Generator, n: int, *, turning: bool = True) -> Relative:
    """`n` motions of up to a second that begin within 3 m of each other."""
    begin = rng.uniform(0, 0.6, n)
    turn = 2.0 if turning else 0.0
    return Relative(
        begin=begin,
        end=begin + rng.uniform(0.05, 0.4, n),
        dx=rng.uniform(-3, 3, n),
        dy=rng.uniform(-3, 3, n),
        vx=rng.uniform(-6, 6, n),
        vy=rng.uniform(-6, 6, n),
        yaw_a=rng.uniform(-10, 10, n),
        yaw_b=rng.uniform(-10, 10, n),
        turn_a=rng.uniform(-turn, turn, n),
        turn_b=rng.uniform(-turn, turn, n),
        half_a=rng.uniform(0.05, 1.2, (2, n)),
        half_b=rng.uniform(0.05, 1.2, (2, n)),
    )


def true_distance(motion: Relative, t: Floats) -> Floats:
    """(n,) at `t` (n,)."""
    into = t - motion.begin
    zero = np.zeros(len(motion))
    a = np.stack([zero, zero, motion.yaw_a + motion.turn_a * into], -1)
    b = np.stack([motion.dx + motion.vx * into, motion.dy + motion.vy * into, motion.yaw_b + motion.turn_b * into], -1)
    return rectangle_distance(a, b, 2 * motion.half_a.T, 2 * motion.half_b.T)


def sampled(motion: Relative, samples: int = 400) -> tuple[Floats, Floats]:
    """Times and distances, (samples, n) each, evenly spread over each motion."""
    t = np.linspace(motion.begin, motion.end, samples)
    return t, np.stack([true_distance(motion, each) for each in t])
