"""The floors of cells, by name."""

from collections.abc import Sequence
from dataclasses import replace

from benchmarks.planned_floors.floors.habits import GridFloor, Habits

VENDORS = ("Alder Robotics", "Birch Robotics", "Corvid Robotics")
AROUND_ASIDE_M, TURNS_ASIDE_M = 0.8, 0.9
SIZES = {"warehouse": (131, 126, 66), "sortation": (55, 66, 39), "scattered": (41, 32, 32)}
"""Robots, and cells along x and y."""


def floor_of(kind: str, seed: int, vendors: Sequence[str] = VENDORS, robots: int | None = None) -> GridFloor:
    """A floor whose robots are shared evenly among vendors; with a single one all robots follow one plan.

    `robots` of `SIZES` if none are given.
    """
    usual, width, height = SIZES[kind]
    robots = robots or usual
    shares = [robots // len(vendors) + (number < robots % len(vendors)) for number in range(len(vendors))]
    habits = tuple(Habits(vendor, share) for vendor, share in zip(vendors, shares, strict=True))
    made_of = GridFloor(kind, habits, width=width, height=height, layout=kind, seed=seed)  # type: ignore[arg-type]
    return replace(made_of, around_aside_m=AROUND_ASIDE_M, turns_aside_m=TURNS_ASIDE_M)
