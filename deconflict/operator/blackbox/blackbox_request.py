"""What one black box is to hold: its near misses, its times, and the engine's state at its start."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from deconflict.settings.site import Site

WARM_UP_S = 15.0
"""The replayed engine has the live engine's learned state this long before `from_s`."""
LEAD_S = 40.0
"""Messages are read from this long before the engine starts. The estimate of a robot's clock needs 32 messages."""
PACE_S = 360.0
"""Messages on topics are read from this long before the state of a running engine. Orders say no times: how fast their
robots drive was learned from the minutes before."""
RUN_UP_S = 60.0
"""An engine that was running runs again from this long before its learned state was taken. So it has the same memory of
what was under way then: forecasts that are not compared with reports yet, open questions, looks at pairs."""


class NearPair(NamedTuple):
    """Two robots that the engine saw within the clearance."""

    a: str
    """UUIDs of the two."""
    b: str
    at_s: float
    """When the engine saw it, seconds since the epoch."""
    vendors: tuple[str, ...] = ()
    """Sorted. Empty if an older release noted the pair."""

    @classmethod
    def from_json(cls, a: str, b: str, at_s: float, vendors: Iterable[str] = ()) -> "NearPair":
        """Raises `TypeError` and `ValueError` if a value has a wrong type."""
        return cls(str(a), str(b), float(at_s), tuple(sorted(map(str, vendors))))


class KnownNearMiss(NamedTuple):
    """A near miss that an earlier box has."""

    robots: tuple[str, str]
    nearest_s: float
    """When the two were nearest, seconds since the epoch."""


class LearnedSnapshot(NamedTuple):
    """The engine's learned state at one tick."""

    at_s: float
    learned: bytes
    """As `learned_state.packed` writes it."""
    burdens_s: dict[str, float]
    """How long each vendor's robots had yielded."""
    is_start: bool = False
    """Whether an engine started with it: that has no memory of what was before."""
    under_way: bytes = b""
    """What it had under way at that tick, packed in the same way."""


@dataclass(frozen=True, slots=True)
class BoxSpan:
    """The times of one box, seconds since the epoch, ascending."""

    lead_s: float
    """The box holds messages from here on."""
    paced_s: float
    """The box holds messages on topics from here on."""
    engine_s: float
    """The replayed engine has the learned state of this time: it starts here, or has run from `lead_s` on."""
    from_s: float
    """A replay gives exactly the decisions from here on."""
    until_s: float

    @classmethod
    def around(
        cls, pairs: Sequence[NearPair], before_s: float, after_s: float, snapshot: LearnedSnapshot | None
    ) -> "BoxSpan":
        """With less than `before_s` where the engine, or what is known of it, began later."""
        from_s, until_s = min(pair.at_s for pair in pairs) - before_s, max(pair.at_s for pair in pairs) + after_s
        engine_s = snapshot.at_s if snapshot else from_s - WARM_UP_S
        exact_s = engine_s if snapshot and snapshot.is_start else engine_s + WARM_UP_S
        is_running = snapshot is not None and not snapshot.is_start
        lead_s, paced_s = (RUN_UP_S, PACE_S) if is_running else (LEAD_S, LEAD_S)
        return cls(engine_s - lead_s, engine_s - paced_s, engine_s, max(from_s, exact_s), until_s)


@dataclass(frozen=True, slots=True)
class BlackBoxRequest:
    """Everything that the worker process needs to write one box."""

    site: Site
    log: Path
    """Directory of the message log."""
    archive: Path
    """Directory of the black boxes."""
    pairs: tuple[NearPair, ...]
    span: BoxSpan
    snapshot: LearnedSnapshot | None
    store: Path
    """The advisory database, with what was decided until `span.until_s`."""
    pending: tuple[str, ...]
    """Revisions until then that are not in the database yet, in order, as JSON."""
    known: tuple[KnownNearMiss, ...] = ()
    """Those of the boxes before."""
