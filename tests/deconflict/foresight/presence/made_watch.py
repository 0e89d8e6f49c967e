"""Robots that report through the real ingest, and the `Presence` that watches them."""

from dataclasses import dataclass, field
from typing import Any

from deconflict.foresight.presence.live_robots import LiveRobots
from deconflict.foresight.presence.presence import Presence
from deconflict.foresight.presence.probably_left import PresenceChanges
from deconflict.runtime.learned_state import resume_all
from ingest.batch import Batch
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.shown.quarantine import Quarantine
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Datum, Reading
from tests.helpers.saying import HALL, LOFT, angle, identity, points, robot, status

NOW_S = 1_790_000_000.0
LINE = Connection(1)
TICK_S = 0.25
DATUMS = (Datum(id=HALL, name="Hall"), Datum(id=LOFT, name="Loft"))


@dataclass
class Watch:
    """A floor whose robots report what a test says. Calls `Presence` as the engine does."""

    learned: dict[str, dict[str, Any]] | None = None
    measures: Measures = field(default_factory=Measures)
    changes: list[PresenceChanges] = field(default_factory=list)
    gone: list[str] = field(default_factory=list)
    now_s: float = 0.0
    """Seconds since the start."""

    def __post_init__(self) -> None:
        self.fleet = Fleet(VendorRegistry(()), FrameRegistry(DATUMS, ()), Reading(), Measures(), Quarantine())
        self.live = LiveRobots()
        self.presence = Presence(self.live, self.measures)
        if self.learned:
            assert not resume_all(self.presence.learners, self.learned)

    def identify(self, name: str, **fields: Any) -> None:
        self.fleet.receive(identity(name, NOW_S + self.now_s, **fields), NOW_S + self.now_s, LINE)

    def say(self, name: str, x: float, y: float = 0.0, speed_mps: float = 0.0, **fields: Any) -> None:
        """A report: the robot goes along x at that speed for `path_s`, and stands then if that ends before the horizon.

        Datum and state may be given too.
        """
        at_s = NOW_S + self.now_s
        datum, path_s = fields.pop("datum", HALL), fields.pop("path_s", 10)
        location = {"x": x, "y": y, "angle": angle(0.0), "planarDatum": datum} | fields.pop("place", {})
        if speed_mps:
            ahead = [(at_s + second, x + speed_mps * second, y, 0.0) for second in range(1, path_s + 1)]
            if path_s < 9:
                ahead.append((at_s + path_s + 1, *ahead[-1][1:]))
            fields = {"path": points(*ahead)} | fields
        self.fleet.receive(status(name, at_s, location=location, **fields), at_s, LINE)

    def tick(self, everything: bool = False) -> PresenceChanges:
        """Receive the reports since the last tick, and advance."""
        self.take(self.fleet.next_batch(NOW_S + self.now_s, everything))
        self.changes.append(self.presence.advance(NOW_S + self.now_s))
        return self.changes[-1]

    def take(self, batch: Batch) -> None:
        batch = self.presence.receive(batch)
        self.gone += batch.gone
        self.live.update(batch)
        self.live.remove(batch.gone)

    def wait(self, seconds: float) -> None:
        """No robot reports for this time. There are fewer ticks if it is long."""
        until_s, tick_s = self.now_s + seconds, max(TICK_S, seconds / 200)
        while self.now_s < until_s:
            self.now_s = min(self.now_s + tick_s, until_s)
            self.tick()

    def drive(
        self, name: str, x: float, y: float = 0.0, speed_mps: float = 1.0, seconds: int = 5, **fields: Any
    ) -> None:
        """A robot reports once a second along x, the last time where the seconds end."""
        for second in range(seconds + 1):
            self.say(name, x + speed_mps * second, y, speed_mps, **fields)
            self.tick()
            if second < seconds:
                self.wait(1.0)

    def stand(self, name: str, x: float, y: float = 0.0, seconds: int = 5, **fields: Any) -> None:
        """A robot reports once a second that it is idle where it stands."""
        self.drive(name, x, y, 0.0, seconds, **{"operationalState": "idle"} | fields)

    def there(self, name: str) -> float:
        return self.presence.silences.there(robot(name))

    def outcomes(self) -> dict[str, float]:
        """Silences that have ended, by outcome."""
        values = self.measures.values.get("deconflict_silences_total", {})
        return {outcome: count for (_, outcome), count in values.items()}


DOOR_M = 20.0


def leave(watch: Watch, robots: int, first: int = 0) -> None:
    """Robots drive to the door one after the other, and are not heard again."""
    for number in range(first, first + robots):
        watch.drive(f"leaver {number}", DOOR_M - 6.0, number % 2, seconds=6)
