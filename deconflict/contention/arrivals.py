"""How wrong a vendor's arrival times have been, and what to make of its next ones.

Of each destination the robot's word is kept, and held against when it came. The error is a ratio, time taken over
time told: what is late is late in proportion to how far it goes.
"""

from collections import deque
from dataclasses import dataclass, field
from math import hypot

from deconflict.learned import Part, numbers

ARRIVED_M = 0.75
"""A robot this near its destination has arrived."""
SHORTEST_S = 5.0
"""Nearer arrivals than this teach nothing: their ratios are noise."""
SAY_AGAIN_S = 30.0
"""A robot's word is kept anew after this time."""
MOST_WORDS = 8
"""Kept of one destination."""
FORGET_S = 600.0
"""A robot this late is not waited for. One that no longer names a destination that lies ahead has another plan."""
MOST_RATIOS = 200
"""Kept of one vendor."""
HALF_LIFE_S = 86400.0
PRIOR_RATIOS = (0.9, 1.0, 1.0, 1.0, 1.3)
"""What is thought of a vendor of which nothing has been seen, each of the weight of one arrival just seen."""
RATIO_BOUNDS = (0.2, 10.0)

Spot = tuple[str, float, float]
"""Datum, x, y."""


@dataclass(slots=True)
class Ratios:
    """Ratios of one vendor, and their quantiles as they were last worked out."""

    seen: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=MOST_RATIOS))
    """When it was seen, and the ratio."""
    quantiles: tuple[float, float, float] | None = None
    """10, 50 and 90 %."""


class Arrivals:
    """What robots said of their arrivals, and how it came out."""

    def __init__(self) -> None:
        self._words: dict[str, dict[Spot, list[tuple[float, float]]]] = {}
        """By robot and destination: when it was said, and the time that was told."""
        self._ratios: dict[str, Ratios] = {}

    def heard(self, robot: str, vendor: str, now_s: float, here: Spot, stops: list[tuple[float, Spot]]) -> None:
        """A robot is at `here` and says when it will be where."""
        if not stops and robot not in self._words:
            return
        words = self._words.setdefault(robot, {})
        for spot in [one for one in words if near(one, here)]:
            self._arrived(vendor, now_s, words.pop(spot))
        ahead = {(datum, round(x, 1), round(y, 1)): t_s for t_s, (datum, x, y) in stops}
        for spot in words.keys() - ahead.keys():
            _, told_s = words[spot][-1]
            if told_s > now_s or told_s + FORGET_S < now_s:
                del words[spot]
        for spot, t_s in ahead.items():
            if near(spot, here):
                continue
            said = words.setdefault(spot, [])
            if len(said) < MOST_WORDS and (not said or now_s - said[-1][0] >= SAY_AGAIN_S):
                said.append((now_s, t_s))
        if not words:
            del self._words[robot]

    def forget(self, robot: str) -> None:
        self._words.pop(robot, None)

    def expected(self, vendor: str, now_s: float, told_s: float) -> tuple[float, float]:
        """When a robot that tells `told_s` will come, and half the width of the middle 80 % of it, never past."""
        low, middle, high = self.quantiles(vendor)
        ahead_s = max(told_s - now_s, 0.0)
        return now_s + middle * ahead_s, (high - low) / 2 * ahead_s

    def quantiles(self, vendor: str) -> tuple[float, float, float]:
        """The 10, 50 and 90 % quantiles of time taken over time told; older arrivals weigh less."""
        ratios = self._ratios.setdefault(vendor, Ratios())
        if ratios.quantiles is None:
            newest_s = ratios.seen[-1][0] if ratios.seen else 0.0
            weighed = [(ratio, 0.5 ** ((newest_s - at_s) / HALF_LIFE_S)) for at_s, ratio in ratios.seen]
            weighed = sorted([*weighed, *((ratio, 1.0) for ratio in PRIOR_RATIOS)])
            ratios.quantiles = (_quantile(weighed, 0.1), _quantile(weighed, 0.5), _quantile(weighed, 0.9))
        return ratios.quantiles

    def seen(self) -> dict[str, int]:
        """How many arrivals are known, by vendor."""
        return {vendor: len(ratios.seen) for vendor, ratios in self._ratios.items()}

    def learned(self) -> Part:
        """By vendor, when arrivals were seen, and their ratios."""
        return {vendor: list(ratios.seen) for vendor, ratios in self._ratios.items() if ratios.seen}

    def resume(self, part: Part) -> None:
        """Go on with what `learned` told. Raises `UnreadableError`."""
        for vendor in part:
            seen = numbers(part, vendor, (None, 2)).tolist()
            self._ratios[vendor] = Ratios(deque(((at_s, ratio) for at_s, ratio in seen), maxlen=MOST_RATIOS))

    def _arrived(self, vendor: str, now_s: float, said: list[tuple[float, float]]) -> None:
        ratios = self._ratios.setdefault(vendor, Ratios())
        low, high = RATIO_BOUNDS
        for at_s, told_s in said:
            if told_s - at_s >= SHORTEST_S:
                ratios.seen.append((now_s, min(max((now_s - at_s) / (told_s - at_s), low), high)))
                ratios.quantiles = None


def near(a: Spot, b: Spot, within_m: float = ARRIVED_M) -> bool:
    return a[0] == b[0] and hypot(a[1] - b[1], a[2] - b[2]) <= within_m


def _quantile(weighed: list[tuple[float, float]], share: float) -> float:
    """The smallest value at which the weight so far reaches `share` of all."""
    wanted, so_far = share * sum(weight for _, weight in weighed), 0.0
    for value, weight in weighed:
        so_far += weight
        if so_far >= wanted:
            return value
    return weighed[-1][0]
