"""A robot that drives on its battery and goes to chargers."""

from collections.abc import Callable
from dataclasses import dataclass

from tests.deconflict.contention.scenes import NOW_S, Script

Levels = Callable[[float], float]


@dataclass
class Driver(Script):
    """A robot that tells the level of its battery, and for how long that lasts."""

    level: Levels = lambda _: 80.0
    lasts_s: float | None = None

    def says(self, name: str, t: float, start_s: float = NOW_S) -> bytes:
        fields = b'{"batteryPercentage":%g,' % self.level(t)
        if self.lasts_s:
            fields += b'"remainingRunTime":%g,' % (self.lasts_s / 3600)
        return fields + super().says(name, t, start_s)[1:]
