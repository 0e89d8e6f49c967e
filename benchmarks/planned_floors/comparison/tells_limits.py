"""The limits for robots that report less, and the figures that are beyond them."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from benchmarks.planned_floors.comparison.tells import ANY, HOURLY, SHOWN, TOLD, TRUE, ByTells
from benchmarks.planned_floors.scoring.alerts import BELIEVER, SERVICE
from benchmarks.planned_floors.scoring.figure import Figure

MOST = "10"
"""What robots tell at most."""
PATHS = ("10", "5", "3", "2", "1")
WITHOUT_A_PATH = ("none", "destination", "timed_destination")
LESS_ANY, LESS_TRUE, TIMES_HOURLY = 0.10, 0.05, 1.2
"""Any alert may be so much below the believer's; alerts true so much below; alerts per robot-hour so many times."""


class Limit(NamedTuple):
    """A figure of the service, and what it must reach."""

    tells: str
    figure: str
    found: Figure
    limit: float
    reason: str
    most: bool = False
    """Whether the limit is the greatest value, not the least."""

    @property
    def held(self) -> bool:
        value = self.found["value"]
        return value is None or (value <= self.limit if self.most else value >= self.limit)

    @property
    def within_interval(self) -> bool:
        """Whether a value beyond the limit could be chance: the limit is in its interval."""
        low, high = self.found["interval"] or (self.found["value"], self.found["value"])
        return bool(low <= self.limit <= high)

    def line(self) -> str:
        value, digits = self.found["value"], 1 if self.figure == HOURLY else 2
        chance = ", within its interval" if self.within_interval else ""
        sign = "above" if self.most else "below"
        return f"{self.tells}: {self.figure} {value:.{digits}f} {sign} {self.limit:.{digits}f} ({self.reason}){chance}"


def limits(by_tells: ByTells, before: ByTells | None) -> list[Limit]:
    """All limits of the figures of one kind. Without a baseline, those that need none."""
    before = before or {}
    return [limit for tells in by_tells for limit in _of(tells, by_tells, before)]


def verdict(by_tells: ByTells, before: ByTells | None) -> str:
    """How many limits hold, and a line for each that does not."""
    found = limits(by_tells, before)
    beyond = [limit for limit in found if not limit.held]
    without = "" if before else " (without a baseline, so that its limits are left out)"
    lines = [f"{len(found) - len(beyond)} of {len(found)} limits hold{without}", *(limit.line() for limit in beyond)]
    return "\n- ".join(lines)


def _of(tells: str, by_tells: ByTells, before: ByTells) -> Iterator[Limit]:
    mine, most = by_tells[tells][SERVICE], by_tells.get(MOST, {}).get(SERVICE, {})
    yield from _told(tells, by_tells, before)
    believed = _value(by_tells[tells][BELIEVER], ANY)
    if tells == "3" and believed is not None:
        yield Limit(tells, ANY, mine[ANY], believed - LESS_ANY, f"the believer's less {LESS_ANY:g}")
    long_path = tells in PATHS and int(tells) >= 3
    least, whose = (most, f"that of {MOST}") if long_path else (_service(before, tells), "the baseline's")
    least_true = _value(least, TRUE)
    if tells != MOST and least_true is not None:
        yield Limit(tells, TRUE, mine[TRUE], least_true - LESS_TRUE, f"{whose} less {LESS_TRUE:g}")
    hourly = _value(most, HOURLY)
    if tells != MOST and hourly is not None:
        yield Limit(tells, HOURLY, mine[HOURLY], TIMES_HOURLY * hourly, f"{TIMES_HOURLY:g} times {MOST}", most=True)
    if tells == MOST:
        yield from _no_worse(mine, _service(before, MOST))


def _told(tells: str, by_tells: ByTells, before: ByTells) -> Iterator[Limit]:
    """Robots are told of no less often than those that tell less, and than before."""
    least = {f"{name} of the same run": _value(_service(by_tells, name), TOLD) for name in _telling_less(tells)}
    if tells != MOST:
        least["the baseline"] = _value(_service(before, tells), TOLD)
    known = {reason: value for reason, value in least.items() if value is not None}
    if known:
        reason = max(known, key=lambda name: known[name])
        yield Limit(tells, TOLD, by_tells[tells][SERVICE][TOLD], known[reason], reason)


def _telling_less(tells: str) -> tuple[str, ...]:
    if tells in PATHS:
        return WITHOUT_A_PATH
    return WITHOUT_A_PATH[:1] if tells in WITHOUT_A_PATH[1:] else ()


def _no_worse(mine: Mapping[str, Figure], before: Mapping[str, Figure]) -> Iterator[Limit]:
    """With all that robots tell, no figure leaves the interval of the baseline on its worse side."""
    for figure in SHOWN:
        interval = before.get(figure, {}).get("interval")
        if interval:
            most = figure == HOURLY
            yield Limit(MOST, figure, mine[figure], interval[most], "the interval of the baseline", most)


def _service(by_tells: ByTells, tells: str) -> Mapping[str, Figure]:
    return by_tells.get(tells, {}).get(SERVICE, {})


def _value(figures: Mapping[str, Figure], name: str) -> float | None:
    value: float | None = figures.get(name, {}).get("value")
    return value
