"""What goes into one black box: whose near misses, from when to when, and what the engine had in mind at the start."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from deconflict.settings.site import Site

WARM_S = 15.0
"""The engine runs for so long before the moments that are promised: what it remembers of those before is then right."""
LEAD_S = 40.0
"""Messages are read for so long before the engine runs: a robot's clock is judged by its last 32."""


class Near(NamedTuple):
    """Two robots within the clearance, as the engine saw it."""

    a: str
    b: str
    at_s: float
    vendors: tuple[str, ...] = ()
    """Sorted; unknown where an older release noted it."""

    @classmethod
    def told(cls, a: str, b: str, at_s: float, vendors: Iterable[str] = ()) -> "Near":
        """From JSON. Raises `TypeError` and `ValueError` where it is none."""
        return cls(str(a), str(b), float(at_s), tuple(sorted(map(str, vendors))))


class Snapshot(NamedTuple):
    """What the engine had learned by a tick, packed, and how long each vendor had yielded."""

    at_s: float
    learned: bytes
    burdens_s: dict[str, float]


@dataclass(frozen=True, slots=True)
class Span:
    """The times of one box, seconds since the epoch, ascending."""

    lead_s: float
    """Messages from here on."""
    engine_s: float
    """The engine runs from here on, with what it had learned by then."""
    from_s: float
    """What was decided from here on is promised to come out again."""
    until_s: float

    @classmethod
    def around(cls, near: Sequence[Near], before_s: float, after_s: float, snapshot: Snapshot | None) -> "Span":
        from_s, until_s = min(one.at_s for one in near) - before_s, max(one.at_s for one in near) + after_s
        engine_s = snapshot.at_s if snapshot else from_s - WARM_S
        return cls(engine_s - LEAD_S, engine_s, from_s, until_s)


@dataclass(frozen=True, slots=True)
class Order:
    """Everything that the making of one box needs, to be handed to another process."""

    site: Site
    log: Path
    shelf: Path
    near: tuple[Near, ...]
    span: Span
    snapshot: Snapshot | None
    store: Path
    """The file of advisories, with what was decided until `span.until_s`."""
    waiting: tuple[str, ...]
    """What of that is not stored yet, in order, as JSON."""
