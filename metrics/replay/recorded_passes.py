"""The passes that the engine makes over a recorded log: when each happens, and the batch that it receives.

A log of this service holds the ticks of its engine, and the passes happen at these ticks. A log of another origin has
no ticks; its passes happen at whole multiples of `TICK_S`. Messages that this service recorded before its engine
started belong to the first pass. The reader therefore holds back the first messages of such a log until it knows
whether the log has ticks.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import floor, inf
from typing import Any

from deconflict.engine.load_shedding import Effort
from deconflict.settings.fleet_factory import fast_fleet_of
from deconflict.settings.site import Site
from deconflict_client.verbs import Followed
from ingest.batch import Batch
from ingest.fleet import fleet_report
from ingest.measures.measures import Measures
from ingest.recording.log_reader import BlackBoxNote, EngineStarted, Event, Received, Tick
from ingest.recording.operator_events import Given, OffFloorMark
from metrics.replay import conformance_counts
from metrics.scoring.vendor_records import LOOK_S

TICK_S = 0.25
"""Time between passes over a log without ticks."""
LONGEST_GAP = 400
"""Number of ticks. If a log without ticks has a longer gap, only this many ticks at its end are passes."""
HELD_S, MOST_HELD = 120.0, 50_000
"""A log of this service may begin this long, and this many messages, before the first tick of its engine."""


@dataclass(frozen=True, slots=True)
class EnginePass:
    """One pass of the engine."""

    now_s: float
    batch: Batch
    effort: Effort = Effort.FULL
    """What the engine had time for at this pass when it was recorded."""
    pending: int = 0
    """Questions for advice that were still unanswered at this pass when it was recorded."""
    is_own_log: bool = False
    """The log has ticks, so this service recorded it, and its robots may have followed the service's advice."""
    followed: tuple[Followed, ...] = ()
    """What robots did as asked at this pass when it was recorded."""
    measures: dict[str, Any] | None = None
    """The receiver's measures, once a minute, for the records of vendors."""


class PassReader:
    """Feeds the messages of one log to one fleet and cuts its state into passes."""

    def __init__(self, site: Site) -> None:
        self.fleet = fast_fleet_of(site, Measures())
        self.messages = 0
        self.first_s, self.last_s = inf, -inf
        """Arrival of the first and the last message."""
        self.now_s = 0.0
        """Time of the newest pass."""
        self._needs_full_batch = False
        """The engine was restarted, so the next batch must hold every robot."""
        self._has_own_ticks = False
        self._minute: float | None = None
        """The minute of the newest pass, in units of `LOOK_S`."""
        self._ticked: int | None = None
        """The newest tick of a log without ticks, in units of `TICK_S`."""
        self._held: list[Received] = []
        """The first messages of a log of this service, until it is known whether the log has ticks."""
        self._is_holding = True

    @property
    def span_s(self) -> float:
        return max(self.last_s - self.first_s, 0.0)

    def passes_of(self, events: Iterable[Event]) -> Iterator[EnginePass]:
        """The passes that the next events of the log cause."""
        for event in events:
            if isinstance(event, Received):
                if self._is_holding:
                    yield from self._feed(self._hold(event))
                    continue
                if not self._has_own_ticks and floor(event.arrival_s / TICK_S) != self._ticked:
                    yield from self._passes_until(event.arrival_s)
                self._feed_message(event)
            elif isinstance(event, Tick | BlackBoxNote | EngineStarted | Given | OffFloorMark):
                self._has_own_ticks = True
                yield from self._feed(self._release())
                self._needs_full_batch |= isinstance(event, EngineStarted)
                if isinstance(event, Given):
                    self.fleet.give(event.uuid, event.vendor)
                if isinstance(event, OffFloorMark):
                    self.fleet.off_floor.note(event)
                if isinstance(event, Tick):
                    yield self._pass(event)

    def last_passes(self) -> Iterator[EnginePass]:
        """The passes after the last event."""
        yield from self._feed(self._release())
        if not self._has_own_ticks and self._ticked is not None:
            yield self._pass(Tick((self._ticked + 1) * TICK_S))

    def measures(self) -> dict[str, Any]:
        """The receiver's measures at present, as a document."""
        fleet_report.measure(self.fleet, self.now_s)
        return self.fleet.measures.as_document()

    def _hold(self, event: Received) -> Sequence[Received]:
        """Hold back a message. Returns all held messages as soon as the log can have no ticks of its own."""
        self._held.append(event)
        is_too_long = len(self._held) >= MOST_HELD or event.arrival_s - self._held[0].arrival_s > HELD_S
        return self._release() if is_too_long or event.connection.id <= 0 else ()

    def _release(self) -> list[Received]:
        """Stop holding back. Returns the messages that were held."""
        held, self._held, self._is_holding = self._held, [], False
        return held

    def _feed(self, events: Iterable[Received]) -> Iterator[EnginePass]:
        """Feed messages to the fleet. For a log without ticks, yields the passes between them."""
        for event in events:
            if not self._has_own_ticks:
                yield from self._passes_until(event.arrival_s)
            self._feed_message(event)

    def _feed_message(self, event: Received) -> None:
        self.messages += 1
        if not self.first_s <= event.arrival_s <= self.last_s:
            self.first_s, self.last_s = min(self.first_s, event.arrival_s), max(self.last_s, event.arrival_s)
        conformance_counts.feed(self.fleet, event)

    def _passes_until(self, now_s: float) -> Iterator[EnginePass]:
        for tick in self._new_ticks(floor(now_s / TICK_S)):
            yield self._pass(Tick(tick * TICK_S))

    def _new_ticks(self, now: int) -> range:
        """The ticks after the newest one up to `now`; empty if `now` is earlier."""
        before = now if self._ticked is None else self._ticked
        self._ticked = max(before, now)
        return range(max(before, now - LONGEST_GAP) + 1, now + 1)

    def _pass(self, tick: Tick) -> EnginePass:
        now_s = tick.now_s
        batch = self.fleet.next_batch(now_s, self._needs_full_batch)
        self.now_s, self._needs_full_batch = now_s, False
        before, self._minute = self._minute, now_s // LOOK_S
        measures = self.measures() if before not in (None, self._minute) else None
        effort, is_own = Effort(tick.effort), self._has_own_ticks
        return EnginePass(now_s, batch, effort, tick.pending, is_own, tick.followed, measures)
