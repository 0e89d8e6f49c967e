"""A recorded log as the passes that the engine makes: what each takes in, and when."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import floor, inf
from typing import Any

from deconflict.engine.load_shedding import Effort
from deconflict.settings.fleet_factory import fast_fleet_of
from deconflict.settings.site import Site
from ingest.batch import Batch
from ingest.measures.measures import Measures
from ingest.recording.log_reader import EngineStarted, Event, Noted, Received, Tick
from metrics.replay import conformance_counts
from metrics.scoring.vendor_records import LOOK_S

TICK_S = 0.25
"""Between passes over a log that has no ticks of its own."""
LONGEST_GAP = 400
"""A gap in a recording of more ticks than this is not stepped through."""
HELD_S, MOST_HELD = 120.0, 50_000
"""For so long, and for so many messages, a log of ours may begin before the engine makes its first pass."""


@dataclass(frozen=True, slots=True)
class Pass:
    """One look at the floor."""

    now_s: float
    batch: Batch
    effort: Effort = Effort.FULL
    """What the engine had time for when it was recorded."""
    pending: int = 0
    """Answers that were still worked out then."""
    heard: bool = False
    """Whether robots may have acted on what was advised: the log is this service's own, with its ticks."""
    measured: dict[str, Any] | None = None
    """What the receiver would tell of itself, once a minute: how vendors do is looked at then."""


class Reading:
    """The messages of one log through one fleet."""

    def __init__(self, site: Site) -> None:
        self.fleet = fast_fleet_of(site, Measures())
        self.messages = 0
        self.first_s, self.last_s = inf, -inf
        self.now_s = 0.0
        """Of the newest pass."""
        self._everything = False
        self._own_ticks = False
        self._looked: float | None = None
        """The last minute, in `LOOK_S`, of which a pass has come."""
        self._ticked: int | None = None
        """The last tick that was made up for a log without any."""
        self._held: list[Received] = []
        """The first messages of a log of ours, until it is known whether it has ticks."""
        self._holds = True

    @property
    def span_s(self) -> float:
        return max(self.last_s - self.first_s, 0.0)

    def take(self, events: Iterable[Event]) -> Iterator[Pass]:
        """The passes that the next events of the log bring about."""
        for event in events:
            if isinstance(event, Received):
                if self._holds:
                    yield from self._heard(self._ready(event))
                    continue
                if not self._own_ticks and floor(event.arrival_s / TICK_S) != self._ticked:
                    yield from self._passes_until(event.arrival_s)
                self._hear(event)
            elif isinstance(event, Tick | Noted | EngineStarted):
                self._own_ticks = True
                yield from self._heard(self._let_go())
                self._everything |= isinstance(event, EngineStarted)
                if isinstance(event, Tick):
                    yield self._pass(event.now_s, Effort(event.effort), event.pending)

    def finish(self) -> Iterator[Pass]:
        """The passes after the last event."""
        yield from self._heard(self._let_go())
        if not self._own_ticks and self._ticked is not None:
            yield self._pass((self._ticked + 1) * TICK_S)

    def _ready(self, event: Received) -> Sequence[Received]:
        """The messages to be heard now: what came to a log of ours before its engine began is of no pass until then."""
        self._held.append(event)
        long = len(self._held) >= MOST_HELD or event.arrival_s - self._held[0].arrival_s > HELD_S
        return self._let_go() if long or event.connection.id <= 0 else ()

    def _let_go(self) -> list[Received]:
        held, self._held, self._holds = self._held, [], False
        return held

    def _heard(self, events: Iterable[Received]) -> Iterator[Pass]:
        """Take in messages, with passes at whole multiples of `TICK_S` for a log that has no ticks of its own."""
        for event in events:
            if not self._own_ticks:
                yield from self._passes_until(event.arrival_s)
            self._hear(event)

    def _hear(self, event: Received) -> None:
        self.messages += 1
        if not self.first_s <= event.arrival_s <= self.last_s:
            self.first_s, self.last_s = min(self.first_s, event.arrival_s), max(self.last_s, event.arrival_s)
        conformance_counts.take(self.fleet, event)

    def _passes_until(self, now_s: float) -> Iterator[Pass]:
        for tick in self._ticks(floor(now_s / TICK_S)):
            yield self._pass(tick * TICK_S)

    def _ticks(self, now: int) -> range:
        """Those that have come since the newest message, up to `now`; none where it was before that."""
        before = now if self._ticked is None else self._ticked
        self._ticked = max(before, now)
        return range(max(before, now - LONGEST_GAP) + 1, now + 1)

    def _pass(self, now_s: float, effort: Effort = Effort.FULL, pending: int = 0) -> Pass:
        batch = self.fleet.cut(now_s, self._everything)
        self.now_s, self._everything = now_s, False
        before, self._looked = self._looked, now_s // LOOK_S
        measured = self.measured() if before not in (None, self._looked) else None
        return Pass(now_s, batch, effort, pending, self._own_ticks, measured)

    def measured(self) -> dict[str, Any]:
        """What the receiver would tell of itself now."""
        self.fleet.measure(self.now_s)
        return self.fleet.measures.as_document()
