"""Whether the receiver records every message."""

from collections.abc import Sequence
from typing import Any

from ingest.measures.measures import joined_values

FAILING = "deconflict_recording_failing"
PACKING_FAILING = "deconflict_recording_packing_failing"
DROPPED = "deconflict_recorded_lines_dropped_total"
DROPPED_SHOWN_S = 60.0
"""Lines that were dropped are reported as degraded for this long."""


class RecordingHealth:
    """As the receiver's measures say. All times are monotonic."""

    def __init__(self) -> None:
        self._is_failing = self._is_packing_failing = False
        self._dropped: float | None = None
        """None before the first measures."""
        self._dropped_s = float("-inf")
        """When the number of dropped lines was last seen to grow."""

    def note_measures(self, documents: Sequence[dict[str, Any]], now_s: float) -> None:
        values = joined_values(documents)
        self._is_failing, self._is_packing_failing = (
            any(values.get(name, {}).values()) for name in (FAILING, PACKING_FAILING)
        )
        dropped = sum(values.get(DROPPED, {}).values())
        if self._dropped is not None and dropped > self._dropped:
            self._dropped_s = now_s
        self._dropped = dropped

    def document(self, now_s: float) -> dict[str, Any]:
        """The part `recording` of the health."""
        dropped = int(self._dropped or 0)
        if self._is_failing:
            reason = "nothing is recorded; the log of the receiver says why"
        elif now_s - self._dropped_s < DROPPED_SHOWN_S:
            reason = "lines were not recorded, because the disk failed or was too slow"
        elif self._is_packing_failing:
            reason = "older segments are not packed and fill the disk sooner; the log of the receiver says why"
        else:
            return {"status": "ok", "lines_dropped": dropped}
        return {"status": "degraded", "reason": reason, "lines_dropped": dropped}
