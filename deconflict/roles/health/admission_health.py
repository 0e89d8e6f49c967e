"""Whether all robots are examined, as the operator face sees it."""

from collections.abc import Sequence
from typing import Any

from ingest.fleet.owners.admission import REMEDY, UNEXAMINED
from ingest.measures.measures import joined_values


def admission_document(documents: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The part `admission` of the health. `documents` are the measures of all receivers."""
    by_source = {source: int(count) for (source,), count in joined_values(documents).get(UNEXAMINED, {}).items()}
    waiting = sum(by_source.values())
    if not waiting:
        return {"status": "ok", "waiting": 0}
    named = ", ".join(f"{count} of {source}" for source, count in sorted(by_source.items()))
    reason = (
        f"{waiting} new robots are shown, but not yet compared with others: {named}; "
        f"a few are each minute; for all at once, {REMEDY}"
    )
    return {"status": "degraded", "reason": reason, "waiting": waiting}
