"""What is counted of waits that are not published."""

from collections.abc import Collection
from typing import Literal

from ingest.measures.measures import Measures

ENDS_S = 3.0
"""What was not found for this long has ended."""


def count_ordinary_waits(
    measures: Measures, kind: Literal["blockage", "contention"], waited_s: Collection[float] = ()
) -> None:
    """Count waits by the kind of advisory that they would have had. Without waits, the metrics appear with 0."""
    measures.count("deconflict_ordinary_waits_total", kind, by=len(waited_s))
    measures.count("deconflict_ordinary_wait_seconds_total", kind, by=sum(waited_s))
