"""Random motions of one rectangle relative to another, and their distances computed as in the oracle."""

import numpy as np
from numpy.random import Generator

from deconflict.sweep.narrowphase import MOTION, Motions
from ingest.batch import Floats
from tests.helpers.oracle import rectangle_distance

SIDES = ("length_a", "width_a", "length_b", "width_b")


def motions(rng: Generator, n: int, *, turning: bool = True, least_m: float = 0.05, most_m: float = 1.2) -> Motions:
    """`n` motions of up to a second that begin within 3 m of each other."""
    made, turn = np.zeros(n, MOTION), 2.0 if turning else 0.0
    made["begin"] = rng.uniform(0, 0.6, n)
    made["end"] = made["begin"] + rng.uniform(0.05, 0.4, n)
    for names, most in ((("dx", "dy"), 3), (("vx", "vy"), 6), (("yaw_a", "yaw_b"), 10), (("turn_a", "turn_b"), turn)):
        for name in names:
            made[name] = rng.uniform(-most, most, n)
    for name in SIDES:
        made[name] = rng.uniform(least_m, most_m, n)
    return completed(made)


def completed(made: Motions) -> Motions:
    """The motions with the derived fields filled in."""
    made["swing"] = 0.0
    for robot in ("a", "b"):
        made[f"cos_{robot}"], made[f"sin_{robot}"] = np.cos(made[f"yaw_{robot}"]), np.sin(made[f"yaw_{robot}"])
        made["swing"] += np.abs(made[f"turn_{robot}"]) * np.hypot(made[f"length_{robot}"], made[f"width_{robot}"])
    return made


def true_distance(motion: Motions, t: Floats) -> Floats:
    """(n,) distances at the times `t` (n,)."""
    into = t - motion["begin"]
    zero = np.zeros(len(motion))
    x, y = motion["dx"] + motion["vx"] * into, motion["dy"] + motion["vy"] * into
    a = np.stack([zero, zero, motion["yaw_a"] + motion["turn_a"] * into], -1)
    b = np.stack([x, y, motion["yaw_b"] + motion["turn_b"] * into], -1)
    sides = [2 * motion[name] for name in SIDES]
    return rectangle_distance(a, b, np.stack(sides[:2], -1), np.stack(sides[2:], -1))


def sampled(motion: Motions, samples: int = 400) -> tuple[Floats, Floats]:
    """Times and distances, (samples, n) each, evenly spread over each motion."""
    t = np.linspace(motion["begin"], motion["end"], samples)
    return t, np.stack([true_distance(motion, each) for each in t])
