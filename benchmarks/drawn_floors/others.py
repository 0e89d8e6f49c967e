"""The robots that are on a floor beside honest ones, by kind. Each kind draws bodies; who sends them is drawn apart."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from benchmarks.drawn_floors.motion import LANE_M, Robot, Says, Span, Way
from ingest.batch import Floats

BEGIN_S = 5.0
"""When others begin to report: honest robots are known by then."""
HEAP_M = 3.0
LARGEST_M = 30.0


class Body(NamedTuple):
    """A robot without its name and sender."""

    way: Way
    length_m: float = 1.0
    width_m: float = 0.6
    begins_s: float = BEGIN_S
    silent: tuple[Span, ...] = ()
    says: Says = "path"


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """Where and when others are drawn."""

    rng: Generator
    side_m: float
    """Honest robots are in a square with a corner at the origin."""
    seconds: float
    honest: Sequence[Robot]
    aside_m: Floats = field(default_factory=lambda: np.zeros(2))
    """(2,) by how much others are away from the place of the honest robots."""

    def points(self, count: int) -> Floats:
        """(count, 2) at random over the floor."""
        return self.aside_m + self.rng.uniform(0, self.side_m, (count, 2))

    def heap(self, count: int, within_m: float = HEAP_M) -> Floats:
        """(count, 2) at random in a small square. Among honest robots, half of the time where one of them passes."""
        if not self.honest or self.aside_m.any() or self.rng.random() < 0.5:
            middle_m = self.points(1)[0]
        else:
            way = self.honest[int(self.rng.integers(len(self.honest)))].way
            x_m, y_m, *_ = way.at(np.array([self.seconds / 2]))
            middle_m = np.array([x_m[0], y_m[0]])
        return np.asarray(middle_m + self.rng.uniform(-within_m / 2, within_m / 2, (count, 2)))

    def yaws(self, count: int) -> list[float]:
        return list(self.rng.uniform(-np.pi, np.pi, count).tolist())


Kind = Callable[[Ground, int], list[Body]]


def _stand(points_m: Floats, yaws_rad: Sequence[float]) -> Iterator[Way]:
    for (x_m, y_m), yaw_rad in zip(points_m.tolist(), yaws_rad, strict=True):
        yield Way.standing(x_m, y_m, yaw_rad)


def _criss_cross(ground: Ground, count: int, within_m: float, speed_mps: float = 1.0) -> list[Way]:
    """Ways to and fro in a small square, each its own."""
    corners = max(int(2 * ground.seconds * speed_mps / within_m), 3)
    middle_m = ground.heap(1, 0.1)[0]
    each_m = middle_m + ground.rng.uniform(-within_m / 2, within_m / 2, (count, corners, 2))
    return [Way.driven(points_m, speed_mps) for points_m in each_m]


def _crossing(ground: Ground, count: int, speeds_mps: Floats) -> list[Way]:
    """Ways over the whole floor, from point to point."""
    ways = []
    for speed_mps in speeds_mps.tolist():
        legs = int(ground.seconds * speed_mps / (ground.side_m / 2)) + 3
        ways.append(Way.driven(ground.points(legs), speed_mps))
    return ways[:count]


def large_spread(ground: Ground, count: int) -> list[Body]:
    """Bodies of 30 m that stand all over the floor."""
    points_m = ground.points(count)
    return [Body(way, LARGEST_M, LARGEST_M) for way in _stand(points_m, ground.yaws(count))]


def large_heaped(ground: Ground, count: int) -> list[Body]:
    """The same in one place."""
    return [Body(way, LARGEST_M, LARGEST_M) for way in _stand(ground.heap(count, 10.0), ground.yaws(count))]


def large_mixed(ground: Ground, count: int) -> list[Body]:
    """Bodies of 10 to 30 m, some of them thin."""
    sizes_m = ground.rng.uniform(10.0, LARGEST_M, (count, 2))
    sizes_m[::3, 1] = 0.5
    ways = _stand(ground.points(count), ground.yaws(count))
    return [Body(way, *size_m) for way, size_m in zip(ways, sizes_m.tolist(), strict=True)]


def centimetres(ground: Ground, count: int) -> list[Body]:
    """Small robots that drive, of a fleet that sends its sizes in centimetres."""
    return [Body(way, 100.0, 60.0) for way in _crossing(ground, count, ground.rng.uniform(0.4, 1.5, count))]


def moving_giants(ground: Ground, count: int) -> list[Body]:
    """Bodies of 10 to 30 m that drive."""
    sizes_m = ground.rng.uniform(10.0, LARGEST_M, count).tolist()
    ways = _crossing(ground, count, ground.rng.uniform(0.5, 2.0, count))
    return [Body(way, size_m, size_m / 2) for way, size_m in zip(ways, sizes_m, strict=True)]


def giants_and_small(ground: Ground, count: int) -> list[Body]:
    """A few giants over a heap of small robots."""
    giants = max(count // 10, 1)
    return [*large_heaped(ground, giants), *standing_heap(ground, count - giants)]


def standing_heap(ground: Ground, count: int) -> list[Body]:
    """All in 3 x 3 m."""
    return [Body(way) for way in _stand(ground.heap(count), ground.yaws(count))]


def moving_heap(ground: Ground, count: int) -> list[Body]:
    """Criss-cross in 3 x 3 m."""
    return [Body(way) for way in _criss_cross(ground, count, HEAP_M)]


def wide_heap(ground: Ground, count: int) -> list[Body]:
    """Criss-cross in 10 x 10 m."""
    return [Body(way) for way in _criss_cross(ground, count, 10.0)]


def trembling_heap(ground: Ground, count: int) -> list[Body]:
    """A heap whose robots report another place each second, and nothing of their way."""
    middles_m, times_s = ground.heap(count), np.arange(ground.seconds + 12)
    shakes_m = ground.rng.normal(0, 0.2, (count, len(times_s), 2))
    ways = [Way.through(times_s, middle_m + shake_m) for middle_m, shake_m in zip(middles_m, shakes_m, strict=True)]
    return [Body(way, says="nothing") for way in ways]


def two_heaps(ground: Ground, count: int) -> list[Body]:
    """A standing heap, and a moving one in the same place."""
    middles_m = ground.heap(count)
    moving = Ground(ground.rng, 0.1, ground.seconds, (), middles_m[0])
    return [
        *(Body(way) for way in _stand(middles_m[: count // 2], ground.yaws(count // 2))),
        *(Body(way) for way in _criss_cross(moving, count - count // 2, HEAP_M)),
    ]


def on_an_honest_robot(ground: Ground, count: int) -> list[Body]:
    """A heap that goes along with one honest robot."""
    way = ground.honest[int(ground.rng.integers(len(ground.honest)))].way
    beside_m = ground.rng.uniform(-1.5, 1.5, (count, 2))
    points_m = np.column_stack([way.x_m, way.y_m])
    return [Body(Way.through(way.t_s, points_m + each_m)) for each_m in beside_m]


def falls_silent(ground: Ground, count: int) -> list[Body]:
    """A moving heap that falls silent at once."""
    return [body._replace(silent=((15.0, np.inf),)) for body in moving_heap(ground, count)]


def standing_falls_silent(ground: Ground, count: int) -> list[Body]:
    """A standing heap that falls silent at once."""
    return [body._replace(silent=((12.0, np.inf),)) for body in standing_heap(ground, count)]


def falls_silent_in_turn(ground: Ground, count: int) -> list[Body]:
    """A moving heap that falls silent one after the other."""
    ends_s = np.linspace(10.0, 30.0, count).tolist()
    bodies = moving_heap(ground, count)
    return [body._replace(silent=((end_s, np.inf),)) for body, end_s in zip(bodies, ends_s, strict=True)]


def silent_again_and_again(ground: Ground, count: int) -> list[Body]:
    """A heap that is silent for twelve seconds of each sixteen."""
    spans = tuple((float(t_s), t_s + 12.0) for t_s in np.arange(10.0, ground.seconds, 16.0))
    return [body._replace(silent=spans) for body in moving_heap(ground, count)]


def wide_falls_silent(ground: Ground, count: int) -> list[Body]:
    """Robots in 10 x 10 m that fall silent under way, at once."""
    return [body._replace(silent=((15.0, np.inf),)) for body in wide_heap(ground, count)]


def all_at_once(ground: Ground, count: int) -> list[Body]:
    """A heap of which nothing is heard until second 20."""
    return [body._replace(begins_s=20.0) for body in moving_heap(ground, count)]


def fast(ground: Ground, count: int) -> list[Body]:
    """Over the whole floor at 10 to 60 m/s."""
    return [Body(way) for way in _crossing(ground, count, ground.rng.uniform(10.0, 60.0, count))]


def fast_straight(ground: Ground, count: int) -> list[Body]:
    """The same, but they say that they go straight on."""
    return [body._replace(says="straight") for body in fast(ground, count)]


def converging(ground: Ground, count: int) -> list[Body]:
    """All go to one point, and are there at the same time, again and again."""
    middle_m, starts_m = ground.heap(1, 0.1)[0], ground.points(count)
    times_s = np.arange(0.0, ground.seconds + 20.0, 10.0)
    is_there = (np.arange(len(times_s)) % 2 == 1)[:, None]
    return [Body(Way.through(times_s, np.where(is_there, middle_m, start_m))) for start_m in starts_m]


def crossing(ground: Ground, count: int) -> list[Body]:
    """Over the whole floor, in each other's way."""
    return [Body(way) for way in _crossing(ground, count, ground.rng.uniform(0.4, 1.8, count))]


def jumping(ground: Ground, count: int) -> list[Body]:
    """Every other second somewhere else, and say that they go straight on."""
    bodies, seconds = [], int(ground.seconds) + 12
    for _ in range(count):
        places_m = np.repeat(ground.points(seconds // 2 + 1), 2, axis=0)
        places_m[1::2] += ground.rng.uniform(-2.0, 2.0, (len(places_m) // 2, 2))
        times_s = np.arange(len(places_m)) + np.tile([0.0, 0.99], len(places_m) // 2)
        bodies.append(Body(Way.through(times_s, places_m), says="straight"))
    return bodies


def convoy(ground: Ground, count: int) -> list[Body]:
    """Packed as closely as robots can be, 0.6 m from middle to middle, side by side, driving through the hall."""
    wide = max(int(np.sqrt(count)), 1)
    row, column = np.divmod(np.arange(count), wide)
    begins_m = ground.aside_m + np.column_stack([-4.0 - 0.6 * row, ground.side_m / 3 + 0.6 * column])
    ahead_m = np.array([ground.seconds + 20.0, 0.0])
    return [Body(Way.driven(np.array([at_m, at_m + ahead_m]), 1.0), 0.5, 0.5) for at_m in begins_m]


def _rows(ground: Ground, count: int, yaws_rad: Sequence[float]) -> Iterator[Way]:
    """Standing side by side, as closely as robots of 0.8 x 0.6 m can be."""
    wide = max(int(np.sqrt(count)), 1)
    row, column = np.divmod(np.arange(count), wide)
    corner_m = ground.points(1)[0]
    return _stand(corner_m + np.column_stack([0.9 * column, 0.7 * row]), yaws_rad)


def parked(ground: Ground, count: int) -> list[Body]:
    """Standing side by side, as closely as robots can be."""
    return [Body(way, 0.8, 0.6) for way in _rows(ground, count, [0.0] * count)]


def waiting_rows(ground: Ground, count: int) -> list[Body]:
    """Side by side, each with a way on which it does not go, through the others."""
    return [Body(way, 0.5, 0.4, says="waits") for way in _rows(ground, count, ground.yaws(count))]


def bound_rows(ground: Ground, count: int) -> list[Body]:
    """Side by side, and all say that they go to the dock."""
    return [Body(way, 0.8, 0.6, says="bound") for way in _rows(ground, count, [0.0] * count)]


def bound(ground: Ground, count: int) -> list[Body]:
    """Over the whole floor, and all say that they go to the dock."""
    return [body._replace(says="bound") for body in crossing(ground, count)]


def in_lane(ground: Ground, count: int) -> list[Body]:
    """To and fro between the ends of the lane."""
    ends_m, beside_m = np.array(LANE_M), ground.rng.uniform(-0.8, 0.8, (count, 2))
    corners_m = np.tile(ends_m, (int(ground.seconds / np.ptp(ends_m[:, 0])) + 2, 1))
    turns = ground.rng.integers(0, 2, count).tolist()
    return [Body(Way.driven(corners_m[turn:] + each_m, 1.0)) for turn, each_m in zip(turns, beside_m, strict=True)]


def chain(ground: Ground, count: int) -> list[Body]:
    """One behind the other along one way through the hall, 0.2 m apart."""
    corners_m = ground.points(int(ground.seconds / 10) + 12)
    long = Way.driven(corners_m, 1.0, begins_s=-1.2 * count)
    points_m = np.column_stack([long.x_m, long.y_m])
    return [Body(Way.through(long.t_s + 1.2 * number, points_m)) for number in range(count)]


def moving_crowd(ground: Ground, count: int) -> list[Body]:
    """A heap that goes through the hall together."""
    beside_m = ground.rng.uniform(-HEAP_M / 2, HEAP_M / 2, (count, 2))
    corners_m = ground.points(int(ground.seconds / ground.side_m) + 4)
    return [Body(Way.driven(corners_m + each_m, 1.0)) for each_m in beside_m]


KINDS: dict[str, Kind] = {
    kind.__name__.replace("_", "-"): kind
    for kind in (
        large_spread, large_heaped, large_mixed, centimetres, moving_giants, giants_and_small,
        standing_heap, moving_heap, wide_heap, trembling_heap, two_heaps, on_an_honest_robot,
        falls_silent, standing_falls_silent, falls_silent_in_turn, silent_again_and_again, wide_falls_silent,
        all_at_once, fast, fast_straight, converging, crossing, jumping, convoy, parked, chain, moving_crowd,
        waiting_rows, bound_rows, bound, in_lane,
    )
}  # fmt: skip
