"""How late the engine's decisions reach the store, and whether any was set aside."""

from collections.abc import Sequence
from typing import Any

from deconflict.cluster.members_health import health_part
from deconflict.roles.health.refusal_health import SHOWN_S
from deconflict.runtime.set_asides import SET_ASIDE
from ingest.measures.measures import joined_values

DELAY = "deconflict_delivery_delay_seconds"
LATE_S = 5.0
"""A longer delay is reported as degraded."""


class DeliveryHealth:
    """As the operator face sees it. All times are monotonic."""

    def __init__(self) -> None:
        self._delay_s, self._taken_s = 0.0, float("-inf")
        """Delay of the last parcel that was taken, and when it was."""
        self._queued_s: float | None = None
        """When the parcel was queued that is not taken yet; None if there is none."""
        self._set_aside_s = float("-inf")
        self._set_aside_by_engines = 0.0

    def arrived(self, queued_s: float) -> None:
        """A parcel has arrived that its sender queued at this time. It may be refused."""
        self._queued_s = queued_s

    def taken(self, now_s: float) -> None:
        """The parcel is stored. If no other parcel waits, its delay is reported for `LATE_S` more."""
        if self._queued_s is not None:
            self._delay_s, self._taken_s, self._queued_s = now_s - self._queued_s, now_s, None

    def set_aside(self, last_s: float) -> None:
        """The operator face has set something aside, last at this time."""
        self._set_aside_s = max(self._set_aside_s, last_s)

    def note_measures(self, documents: Sequence[dict[str, Any]], now_s: float) -> None:
        """Take in the measures of all engines: they set aside, too, and in a cluster they have delays of their own."""
        values = joined_values(documents)
        count = sum(values.get(SET_ASIDE, {}).values())
        if count > self._set_aside_by_engines:
            self._set_aside_s = now_s
        self._set_aside_by_engines = count

    def delay_s(self, now_s: float, documents: Sequence[dict[str, Any]] = ()) -> float:
        """The age of the oldest decision that is not stored. `documents` are the newest measures of all engines."""
        last_s = self._delay_s if now_s - self._taken_s < LATE_S else 0.0
        own_s = last_s if self._queued_s is None else now_s - self._queued_s
        return max([own_s, *joined_values(documents).get(DELAY, {}).values()])

    def document(self, now_s: float, documents: Sequence[dict[str, Any]]) -> dict[str, Any]:
        """The part `delivery` of the health."""
        delay_s, ago_s = self.delay_s(now_s, documents), now_s - self._set_aside_s
        reasons = []
        if delay_s > LATE_S:
            reasons.append(f"advisories reach the store {delay_s:.0f} s late")
        if ago_s < SHOWN_S:
            reasons.append(f"a revision was set aside {ago_s:.0f} s ago, and nobody received it; the log names it")
        return health_part(reasons, delay_s=round(delay_s, 1))
