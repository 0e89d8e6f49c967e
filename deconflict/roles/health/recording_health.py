"""Whether the receiver records every message."""

from collections.abc import Sequence
from typing import Any

from deconflict.cluster.members_health import health_part
from ingest.measures.measures import joined_values

FAILING = "deconflict_recording_failing"
PACKING_FAILING = "deconflict_recording_packing_failing"
DROPPED = "deconflict_recorded_lines_dropped_total"


class RecordingHealth:
    """As the receiver's measures say. `refused_or_lost` says that lines were dropped."""

    def __init__(self) -> None:
        self._is_failing = self._is_packing_failing = False
        self._dropped = 0

    def note_measures(self, documents: Sequence[dict[str, Any]]) -> None:
        values = joined_values(documents)
        self._is_failing, self._is_packing_failing = (
            any(values.get(name, {}).values()) for name in (FAILING, PACKING_FAILING)
        )
        self._dropped = int(sum(values.get(DROPPED, {}).values()))

    def document(self) -> dict[str, Any]:
        """The part `recording` of the health."""
        reason = ""
        if self._is_failing:
            reason = "nothing is recorded; the log of the receiver says why"
        elif self._is_packing_failing:
            reason = "older segments are not packed and fill the disk sooner; the log of the receiver says why"
        return health_part([reason], lines_dropped=self._dropped)
