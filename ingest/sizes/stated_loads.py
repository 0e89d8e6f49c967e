"""The size and the place of loads as robots state them, by the one rule of size."""

from collections.abc import Iterator, Sequence
from math import cos, sin
from typing import NamedTuple

from ingest.sizes.size_limit import (
    ALIKE,
    LOAD_IN_OTHER_UNIT,
    LOAD_OVER_LIMIT,
    UNITS,
    Rectangle,
    are_within,
    converted_text,
    over_limit_text,
    size_text,
)

SHORTEST_M = 1e-3
"""A load with a shorter side is none."""
EQUAL = 1.05
"""Two statements of a load's side differ by less than this factor."""
MOST_NOTES = 3
"""Loads of a robot of which people are shown how they are read."""
_METRES = ("", 1.0)


class StatedLoad(NamedTuple):
    """A box on a robot, as stated."""

    x: float
    """The centre of its bottom in the robot's frame."""
    y: float
    z: float
    theta_rad: float
    length: float
    width: float
    height: float


class LoadBox(NamedTuple):
    """The rectangle about a robot's load, in the robot's frame: x along the heading, y to its left."""

    back_m: float
    front_m: float
    right_m: float
    left_m: float
    top_m: float
    """Height of its upper side."""


class LoadsReading(NamedTuple):
    """How the loads of a robot are read."""

    box: LoadBox | None = None
    """About all of them; None if none has a box."""
    rules: tuple[str, ...] = ()
    """Codes of the rules from which they deviate."""
    notes: tuple[str, ...] = ()
    """The same for people."""


Unit = tuple[str, float]
"""Its name, "" for metres, and how many are a metre."""


class _LoadReading(NamedTuple):
    """One load, as stated and in metres."""

    stated: StatedLoad
    load: StatedLoad
    rules: tuple[str, ...] = ()
    unit: str = ""
    """In which it was stated; "" for metres, or if nobody knows."""


NO_LOADS = LoadsReading()


def read_loads(loads: Sequence[StatedLoad], body: Rectangle | None, robot: Rectangle, largest_m: float) -> LoadsReading:
    """The box about all loads of a robot. `body` shows in which unit they are: the robot, if its size is known."""
    boxed = [load for load in loads if min(load.length, load.width) >= SHORTEST_M]
    if not boxed:
        return NO_LOADS
    readings = [_read_load(load, body, largest_m) for load in boxed]
    xs, ys = zip(*(corner for reading in readings for corner in _corners(reading.load)), strict=True)
    top_m = max(0.0, *(reading.load.z + reading.load.height for reading in readings))
    back_m, front_m = _beside((min(xs), max(xs)), (robot.back_m, robot.front_m), largest_m)
    right_m, left_m = _beside((min(ys), max(ys)), (robot.right_m, robot.left_m), largest_m)
    box = LoadBox(back_m, front_m, right_m, left_m, min(top_m, largest_m))
    odd = [reading for reading in readings if reading.rules]
    rules = [rule for reading in odd for rule in reading.rules]
    notes = [note for reading in odd[:MOST_NOTES] for note in _notes(reading, largest_m)]
    if LOAD_OVER_LIMIT not in rules and box != (min(xs), max(xs), min(ys), max(ys), top_m):
        rules.append(LOAD_OVER_LIMIT)
        notes.append(f"robot and load are beyond reading.largest_body_m = {largest_m:g} m; they count as that")
    return LoadsReading(box, tuple(dict.fromkeys(rules)), tuple(dict.fromkeys(notes)))


def _notes(reading: _LoadReading, largest_m: float) -> Iterator[str]:
    stated = reading.stated
    what = f"a load of {size_text(*stated[4:])} at {size_text(*stated[:3]).replace(' x', ',')}"
    if reading.unit:
        yield converted_text(what, reading.unit, "the size of robot and load", largest_m)
    if LOAD_OVER_LIMIT in reading.rules:
        yield over_limit_text(what, largest_m)


def _corners(load: StatedLoad) -> list[tuple[float, float]]:
    c, s = cos(load.theta_rad), sin(load.theta_rad)
    halves_m = [(a * load.length / 2, b * load.width / 2) for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
    return [(load.x + c * along - s * across, load.y + s * along + c * across) for along, across in halves_m]


def _beside(load: tuple[float, float], robot: tuple[float, float], largest_m: float) -> tuple[float, float]:
    """The load along one axis. If it is beyond the limit together with the robot, it takes all that is within it."""
    low_m, high_m = min(load[0], robot[0]), max(load[1], robot[1])
    if high_m - low_m <= largest_m:
        return load
    first_m, last_m = max(low_m, robot[1] - largest_m), min(robot[0], high_m - largest_m)
    start_m = min(max(-largest_m / 2, first_m), last_m)
    return start_m, start_m + largest_m


def _read_load(stated: StatedLoad, body: Rectangle | None, largest_m: float) -> _LoadReading:
    """One load. What another unit than metres explains is converted, and what nothing explains stands at the limit."""
    is_far = max(abs(stated.x), abs(stated.y)) > largest_m
    if max(stated.length, stated.width, stated.height, stated.z) <= largest_m and not is_far:
        return _LoadReading(stated, stated)
    sides, of_sides = _sides((stated.length, stated.width), body, largest_m)
    place, of_place = _place(stated, sides, of_sides or _METRES, body if of_sides else None, largest_m)
    longest_m = ALIKE * max(*sides, body.longer_m) if body and of_sides else 0.0
    height, of_height = _height(stated.height, of_sides or _METRES, longest_m, largest_m)
    is_raised_alike = of_place is None or of_place is _METRES
    z, of_z = _height(place[2], (of_sides if is_raised_alike else of_place) or _METRES, longest_m, largest_m)
    load = StatedLoad(*place[:2], z, stated.theta_rad, *sides, height)
    units = of_sides, of_place, of_height, of_z
    unit = next((each[0] for each in units if each and each[0]), "")
    is_over = None in units
    rules = *((LOAD_IN_OTHER_UNIT,) if unit else ()), *((LOAD_OVER_LIMIT,) if is_over else ())
    return _LoadReading(stated, load, rules, unit)


def _sides(
    stated: tuple[float, float], body: Rectangle | None, largest_m: float
) -> tuple[tuple[float, float], Unit | None]:
    """Length and width, and their unit; None if they stand at the limit."""
    if max(stated) <= largest_m:
        return stated, _METRES
    for unit in UNITS if body else ():
        length, width = (side / unit[1] for side in stated)
        mixed = tuple(side / unit[1] if side > largest_m else side for side in stated)
        for sides in ((mixed[0], mixed[1]), (length, width)):
            if body and min(sides) >= SHORTEST_M and max(sides) <= ALIKE * body.longer_m:
                return sides, unit
    return (min(stated[0], largest_m), min(stated[1], largest_m)), None


def _place(
    stated: StatedLoad, sides: tuple[float, float], of_sides: Unit, body: Rectangle | None, largest_m: float
) -> tuple[tuple[float, float, float], Unit | None]:
    """Where the load is, and the unit of that; None if it is put as far out as the limit allows.

    Some senders give the size a second time instead of a place: that load is in the middle of the robot.
    """
    place, is_far = stated[:3], max(abs(stated.x), abs(stated.y)) > largest_m
    repeated = next((unit for unit in (*UNITS, of_sides) if is_far and _repeats(place, sides, unit[1])), None)
    if body and repeated:
        return ((body.back_m + body.front_m) / 2, (body.right_m + body.left_m) / 2, 0.0), repeated
    units = UNITS if is_far else (_METRES, of_sides)
    for overhang_m in (0.0, max(sides) / 2):
        for unit in units if body else ():
            x, y = (value / unit[1] for value in place[:2])
            if body and body.is_near(x, y, overhang_m):
                return (x, y, place[2]), unit
    x, y = (min(max(value, -largest_m), largest_m) for value in place[:2])
    return (x, y, place[2]), None if is_far else _METRES


def _repeats(place: tuple[float, ...], sides: tuple[float, float], per_m: float) -> bool:
    return all(are_within(value / per_m, side, EQUAL) for value, side in zip(place, sides, strict=False))


def _height(value: float, unit: Unit, highest_m: float, largest_m: float) -> tuple[float, Unit | None]:
    """A height, and its unit; None if it stands at the limit. In a box in another unit it may be in metres."""
    if value <= (largest_m if unit is _METRES else highest_m):
        return value, _METRES
    for other in UNITS if unit is _METRES else (unit,):
        if value / other[1] <= highest_m:
            return value / other[1], other
    return min(value, largest_m), None
