"""Random encounters of two robots, by family. Each maker gets a generator and returns the two forecasts."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from ingest.batch import Floats, Forecasts
from tests.helpers.oracle import truth

NOW_S = 1_800_000_000.3
HORIZON_S = 10.0
Pair = tuple[Forecasts, Forecasts]


def robot(
    t: Floats | Sequence[float],
    x: Floats | Sequence[float],
    y: Floats | Sequence[float],
    yaw: Floats | Sequence[float] | float,
    size: Sequence[float] | Floats,
    *,
    floor: Sequence[int] | NDArray[np.int64] | int = 0,
    height: tuple[float, float] = (0.0, 1.0),
) -> Forecasts:
    """One robot; `t` counts from `NOW_S`."""
    k = len(t)
    return Forecasts(
        np.array([0, k]),
        NOW_S + np.asarray(t, np.float64),
        np.array(x, np.float64),
        np.array(y, np.float64),
        np.broadcast_to(np.asarray(yaw, np.float64), k).copy(),
        np.broadcast_to(np.asarray(floor, np.int64), k).copy(),
        np.array([size[0]], np.float64),
        np.array([size[1]], np.float64),
        np.array([height[0]]),
        np.array([height[1]]),
    )


def size(rng: Generator) -> Floats:
    return rng.uniform([0.5, 0.4], [2.5, 1.2])


def wanderer(rng: Generator, *, speed_mps: float = 2.0, spread_m: float = 4.0, knots: int = 0) -> Forecasts:
    """Knots at irregular times before and after `NOW_S`, with headings along the path or random ones."""
    k = knots or int(rng.integers(2, 13))
    t = np.sort(rng.uniform(-1.0, 12.0, k))
    t[0] = -rng.uniform(0.1, 1.0)
    t = np.unique(t)
    direction = rng.uniform(-np.pi, np.pi) + np.cumsum(rng.normal(0, 0.6, len(t)))
    reach = rng.uniform(0, speed_mps) * np.diff(t, prepend=t[0])
    x = np.cumsum(reach * np.cos(direction)) + rng.uniform(-spread_m, spread_m)
    y = np.cumsum(reach * np.sin(direction)) + rng.uniform(-spread_m, spread_m)
    return robot(t, x, y, direction if rng.random() < 0.7 else rng.uniform(-np.pi, np.pi, len(t)), size(rng))


def moved(forecast: Forecasts, dx: float, dy: float) -> Forecasts:
    return replace(forecast, x_m=forecast.x_m + dx, y_m=forecast.y_m + dy)


def random(rng: Generator) -> Pair:
    return wanderer(rng), wanderer(rng)


def graze(rng: Generator, clearance_m: float = 0.0) -> Pair:
    """One passes a standing robot side by side, 1e-2 to 1e-6 m above or below the clearance."""
    (la, wa), (lb, wb) = size(rng), size(rng)
    off = rng.choice([-1, 1]) * 10.0 ** -int(rng.integers(2, 7))
    yaw, speed = rng.uniform(-np.pi, np.pi), rng.uniform(0.3, 2)
    along = np.array([-4.0, 4.0])
    across = np.full(2, (wa + wb) / 2 + clearance_m + off)
    c, s = np.cos(yaw), np.sin(yaw)
    passing = robot([0, 8 / speed], c * along - s * across, s * along + c * across, yaw, (lb, wb))
    return robot([-1], [0], [0], yaw, (la, wa)), passing


def near_miss(rng: Generator, clearance_m: float = 0.0) -> Pair:
    """They turn on the spot, corner to corner, up to two centimetres above or below the clearance."""
    (la, wa), (lb, wb) = size(rng), size(rng)
    apart = (np.hypot(la, wa) + np.hypot(lb, wb)) / 2 + clearance_m + rng.uniform(-0.02, 0.02)
    t = np.arange(0.0, 11.0)
    turns = rng.uniform(-2, 2, 2)
    there = rng.uniform(-np.pi, np.pi)
    a = robot(t, 0 * t, 0 * t, turns[0] * t, (la, wa))
    return a, robot(t, 0 * t + apart * np.cos(there), 0 * t + apart * np.sin(there), turns[1] * t, (lb, wb))


def contact_at_start(rng: Generator) -> Pair:
    a, b = wanderer(rng, spread_m=0.3), wanderer(rng, spread_m=0.3)
    return a, b


def identical_motion(rng: Generator, clearance_m: float = 0.0) -> Pair:
    a = wanderer(rng)
    (la, wa), off = size(rng), rng.choice([-1.0, 1.0]) * 10.0 ** -int(rng.integers(1, 5))
    a = replace(a, length_m=np.array([la]), width_m=np.array([wa]), yaw_rad=np.full(len(a.t_s), a.yaw_rad[0]))
    yaw, apart = float(a.yaw_rad[0]), wa + clearance_m + off
    return a, moved(a, -np.sin(yaw) * apart, np.cos(yaw) * apart)


def stationary(rng: Generator) -> Pair:
    def stands() -> Forecasts:
        return robot([-1], [rng.uniform(-1, 1)], [rng.uniform(-1, 1)], rng.uniform(-np.pi, np.pi), size(rng))

    return stands(), stands() if rng.random() < 0.5 else wanderer(rng, spread_m=2.0)


def spinning(rng: Generator) -> Pair:
    """One spins on the spot at up to 3 rad/s, beside a wanderer or another spinning one."""

    def spins() -> Forecasts:
        t = np.arange(-0.5, 11.0, 0.9)
        yaw = rng.uniform(-3, 3) * t + rng.uniform(-np.pi, np.pi)
        return robot(t, 0 * t + rng.uniform(-1.5, 1.5), 0 * t + rng.uniform(-1.5, 1.5), yaw, size(rng))

    return spins(), spins() if rng.random() < 0.5 else wanderer(rng, spread_m=2.0)


def head_on(rng: Generator) -> Pair:
    yaw, offset = rng.uniform(-np.pi, np.pi), rng.normal(0, 0.5)
    c, s = np.cos(yaw), np.sin(yaw)

    def comes(side: float) -> Forecasts:
        along = side * np.array([rng.uniform(2, 8), -rng.uniform(0, 8)])
        across = np.array([side, side]) * offset / 2
        heading = yaw + np.pi if side > 0 else yaw
        times = [-rng.uniform(0, 1), rng.uniform(5, 12)]
        return robot(times, c * along - s * across, s * along + c * across, heading, size(rng))

    return comes(1), comes(-1)


def thin(rng: Generator) -> Pair:
    a, b = wanderer(rng, spread_m=1.5), wanderer(rng, spread_m=1.5)
    return replace(a, width_m=np.array([0.01])), replace(b, length_m=np.array([0.01])) if rng.random() < 0.5 else b


def far_from_origin(rng: Generator) -> Pair:
    dx, dy = rng.uniform(-1, 1, 2) * 10_000
    a, b = graze(rng) if rng.random() < 0.3 else random(rng)
    return moved(a, dx, dy), moved(b, dx, dy)


def fast(rng: Generator) -> Pair:
    return wanderer(rng, speed_mps=16.0, spread_m=5.0), wanderer(rng, speed_mps=16.0, spread_m=5.0)


def full_turns(rng: Generator) -> Pair:
    """Both make several turns while driving, with less than half a turn between knots."""

    def turns() -> Forecasts:
        t = np.linspace(-0.2, 10.5, 16)
        yaw = rng.choice([-1, 1]) * rng.uniform(1.0, 2.9) * np.arange(16.0) + rng.uniform(-np.pi, np.pi)
        (x, y), (vx, vy) = rng.uniform(-3, 3, 2), rng.uniform(-0.6, 0.6, 2)
        return robot(t, x + vx * t, y + vy * t, (yaw + np.pi) % (2 * np.pi) - np.pi, size(rng))

    return turns(), turns()


def zero_length_segments(rng: Generator) -> Pair:
    """Pauses, and knots only microseconds apart."""

    def pauses() -> Forecasts:
        w = wanderer(rng, spread_m=2.5, knots=6)
        t, stay = w.t_s - NOW_S, np.repeat(np.arange(len(w.t_s)), 2)
        pause = np.minimum(10.0 ** rng.uniform(-5.5, 0, len(t) - 1), np.diff(t) / 2)
        times = np.stack([t, t + np.append(pause, 1.0)], -1).ravel()
        yaw = w.yaw_rad[stay] + np.where(np.arange(len(stay)) % 2, rng.normal(0, 0.1), 0.0)
        return robot(times, w.x_m[stay], w.y_m[stay], yaw, size(rng))

    return pauses(), pauses()


def knots_on_the_second(rng: Generator) -> Pair:
    """One has knots on the edges of slabs, the other two to three hundred knots in between."""
    t = np.arange(-1.0, 12.0) + 0.7
    a = robot(t, rng.uniform(-1, 1) * t, np.cumsum(rng.normal(0, 0.7, 13)), rng.uniform(-3, 3, 13), size(rng))
    t = np.cumsum(rng.uniform(1e-4, 0.1, int(rng.integers(200, 300)))) - 0.5
    x, y = rng.uniform(-2, 2, 2)
    vx, vy, turn = rng.uniform(-1, 1, 3)
    return a, robot(t, x + vx * t + 0.2 * np.sin(3 * t), y + vy * t, turn * t, size(rng))


def late_or_early(rng: Generator) -> Pair:
    """Each appears within the horizon, stops within it, or has a forecast that ended long ago."""

    def one() -> Forecasts:
        w = wanderer(rng, spread_m=1.0)
        shift = rng.choice([-30.0, rng.uniform(0, 9), -rng.uniform(4, 11)])
        return replace(w, t_s=w.t_s + shift)

    return one(), one()


def floor_changes(rng: Generator) -> Pair:
    def rides() -> Forecasts:
        w = wanderer(rng, spread_m=2.0, knots=10)
        return replace(w, floor=np.repeat(rng.integers(-1, 3, 5), 2)[: len(w.t_s)])

    return rides(), rides() if rng.random() < 0.6 else wanderer(rng, spread_m=2.0)


def heights(rng: Generator) -> Pair:
    """One may pass under the other."""

    def low_or_high() -> Forecasts:
        bottom = rng.choice([0.0, 0.3, 1.0])
        top = rng.choice([np.inf, bottom, bottom + 0.3, bottom + 1.0])
        w = wanderer(rng, spread_m=2.0)
        return replace(w, bottom_m=np.array([rng.choice([-np.inf, bottom])]), top_m=np.array([top]))

    return low_or_high(), low_or_high()


Maker = Callable[[Generator, float], Pair]


def _plain(maker: Callable[[Generator], Pair]) -> Maker:
    return lambda rng, _clearance_m: maker(rng)


FAMILIES: dict[str, Maker] = {
    "graze": graze,
    "near_miss": near_miss,
    "identical_motion": identical_motion,
} | {
    maker.__name__: _plain(maker)
    for maker in (
        random,
        contact_at_start,
        stationary,
        spinning,
        head_on,
        thin,
        far_from_origin,
        fast,
        full_turns,
        zero_length_segments,
        knots_on_the_second,
        late_or_early,
        floor_changes,
        heights,
    )
}


def encounters(family: str, count: int, seed: int, clearance_m: float) -> Forecasts:
    """`count` pairs in rows 2 i and 2 i + 1. Each pair has its own floors, so that one sweep handles all."""
    rng = np.random.default_rng(seed)
    return Forecasts.joined(
        replace(forecast, floor=np.where(forecast.floor >= 0, forecast.floor + 4 * number, -1))
        for number in range(count)
        for forecast in FAMILIES[family](rng, clearance_m)
    )


def grazing(family: str, count: int, seed: int, clearance_m: float) -> Forecasts:
    """Encounters of a family, moved apart until their smallest distance is 1e-2 to 1e-6 m off the clearance.

    If that distance would be negative, they overlap by about a micrometre.
    """
    rng = np.random.default_rng(seed)
    start = _meeting_at(encounters(family, count, seed, clearance_m), rng.uniform(0.5, 9.5, count))
    pairs = rows_of_pairs(count)
    wanted = clearance_m + rng.choice([-1, 1], count) * 10.0 ** -rng.integers(2, 7, count)
    direction = rng.uniform(-np.pi, np.pi, count)
    owner = np.repeat(np.arange(2 * count), np.diff(start.start))
    near, far = np.zeros(count), np.full(count, 60.0)

    def drawn(apart: Floats) -> Forecasts:
        by = np.where(owner % 2, apart[owner // 2], 0.0)
        angle = direction[owner // 2]
        return replace(start, x_m=start.x_m + by * np.cos(angle), y_m=start.y_m + by * np.sin(angle))

    for _ in range(26):
        middle = (near + far) / 2
        there = truth(drawn(middle), pairs, now_s=NOW_S, horizon_s=HORIZON_S, clearance_m=clearance_m)
        closer = there.closest_m < np.maximum(wanted, 1e-7)
        near, far = np.where(closer, middle, near), np.where(closer, far, middle)
    return drawn(np.where(wanted < 0, near, far))


def _meeting_at(forecasts: Forecasts, into_s: Floats) -> Forecasts:
    """The forecasts with every second robot moved to where the one before it is `into_s` after `NOW_S`."""
    x, y = forecasts.x_m.copy(), forecasts.y_m.copy()
    for (first, second), t in zip(rows_of_pairs(len(into_s)), NOW_S + into_s, strict=True):
        a, b = (slice(*forecasts.start[row : row + 2]) for row in (first, second))
        for axis in (x, y):
            axis[b] += np.interp(t, forecasts.t_s[a], axis[a]) - np.interp(t, forecasts.t_s[b], axis[b])
    return replace(forecasts, x_m=x, y_m=y)


def rows_of_pairs(count: int) -> list[tuple[int, int]]:
    return [(2 * i, 2 * i + 1) for i in range(count)]
