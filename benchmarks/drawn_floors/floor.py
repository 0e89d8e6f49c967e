"""One floor by its number: honest robots that cross each other's way, and others of one to three kinds."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from benchmarks.drawn_floors.motion import Robot, Way
from benchmarks.drawn_floors.others import KINDS, Body, Ground

AREA_M2 = 25.0
"""Of each honest robot."""
HONEST = ("Alder", "Basalt", "Corvid", "Dune")
PLACES = ("beside", "half", "among", "among")
"""Where others are: away from honest robots, half among them, or where they are."""
GAP_M = 35.0
"""Between honest robots and others that are beside them: no body reaches across."""
MAKERS = ("one", "few", "64", "own")
SOURCES = ("one", "one", "one", "four", "shared", "own")
"""Others have one address, four, that of an honest vendor, or each its own."""


@dataclass(frozen=True, slots=True)
class Floor:
    """Honest robots and others."""

    number: int
    kinds: tuple[str, ...]
    place: str
    makers: str
    sources: str
    honest: tuple[Robot, ...]
    others: tuple[Robot, ...]


def honest_floor(robots: int, seconds: float, seed: int) -> tuple[Robot, ...]:
    """Only honest robots."""
    rng = np.random.default_rng([seed, robots, 7])
    return _honest(rng, robots, seconds, f"reference {seed}")


def drawn_floor(number: int, robots: int, seconds: float, seed: int = 0, kinds: tuple[str, ...] = ()) -> Floor:
    """The floor of a number, with `robots` in all. If `kinds` are not given, they are drawn: each is the first kind
    of some floors."""
    rng = np.random.default_rng([seed, number])
    honest = _honest(rng, int(robots * rng.uniform(0.2, 0.5)), seconds, f"{seed} {number}")
    if not kinds:
        names = list(KINDS)
        more = rng.choice(names, int(rng.integers(0, 3)) if number >= len(names) else 0, replace=False).tolist()
        kinds = tuple(dict.fromkeys([names[number % len(names)], *more]))
    place, makers, sources = str(rng.choice(PLACES)), str(rng.choice(MAKERS)), str(rng.choice(SOURCES))
    side_m = float(np.sqrt(len(honest) * AREA_M2))
    aside_m = np.array([{"beside": side_m + GAP_M, "half": 0.75 * side_m, "among": 0.0}[place], 0.0])
    ground = Ground(rng, side_m, seconds, honest, aside_m)
    shares = np.array_split(np.arange(robots - len(honest)), len(kinds))
    bodies = [body for kind, share in zip(kinds, shares, strict=True) for body in KINDS[kind](ground, len(share))]
    others = _sent_by(rng, bodies, f"{seed} {number}", makers, sources)
    return Floor(number, kinds, place, makers, sources, honest, others)


def _sent_by(rng: Generator, bodies: list[Body], floor: str, makers: str, sources: str) -> tuple[Robot, ...]:
    """The bodies as robots, with their makers and addresses."""
    count = {"one": 1, "few": 4, "64": 64, "own": len(bodies)}[makers]
    address: Callable[[int], str] = {
        "one": lambda _: "10.9.0.1",
        "four": lambda number: f"10.9.0.{number % 4 + 1}",
        "shared": lambda _: _address(HONEST[0]),
        "own": lambda number: f"10.9.{number // 250}.{number % 250}",
    }[sources]
    phases_s = rng.uniform(0, 1, len(bodies)).round(3).tolist()
    return tuple(
        Robot(f"other {floor} {number}", f"Maker {number % count}", address(number), phase_s=phase_s, **body._asdict())
        for number, (body, phase_s) in enumerate(zip(bodies, phases_s, strict=True))
    )


def _address(maker: str) -> str:
    return f"10.1.0.{HONEST.index(maker) + 1}"


def _honest(rng: Generator, robots: int, seconds: float, floor: str) -> tuple[Robot, ...]:
    side_m = float(np.sqrt(robots * AREA_M2))
    found = []
    for number in range(robots):
        maker = HONEST[number % len(HONEST)]
        length_m, width_m = rng.uniform(0.6, 1.4), rng.uniform(0.5, 1.0)
        robot = Robot(
            f"honest {floor} {number}", maker, _address(maker), tour(rng, side_m, seconds), length_m, width_m, 0.0
        )
        found.append(replace(robot, phase_s=round(float(rng.uniform(0, 1)), 3), is_honest=True))
    return tuple(found)


def tour(rng: Generator, side_m: float, seconds: float, speeds_mps: tuple[float, float] = (0.5, 1.5)) -> Way:
    """From point to point, with a rest now and then; one robot in six stands."""
    point_m, speed_mps = rng.uniform(0, side_m, 2), rng.uniform(*speeds_mps)
    if rng.random() < 1 / 6:
        return Way.standing(float(point_m[0]), float(point_m[1]), float(rng.uniform(-np.pi, np.pi)))
    times_s, points_m = [0.0], [point_m]
    while times_s[-1] < seconds + 12.0:
        if rng.random() < 0.15:
            times_s.append(times_s[-1] + rng.uniform(2.0, 6.0))
            points_m.append(points_m[-1])
        points_m.append(rng.uniform(0, side_m, 2))
        times_s.append(times_s[-1] + max(float(np.hypot(*(points_m[-1] - points_m[-2]))), 0.1) / speed_mps)
    return Way.through(times_s, np.array(points_m))
