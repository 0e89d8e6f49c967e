"""The advisories that were open at the start of a black box, and those that were published in its time."""

from pathlib import Path
from typing import NamedTuple

from deconflict.operator.blackbox.blackbox_request import BoxSpan
from deconflict.operator.store.pending_writes import PendingWrites, open_at_time
from deconflict.operator.store.tables import between, open_at, read_only
from deconflict_client.advisory import AnyAdvisory
from deconflict_client.situations import advisories_of
from ingest.plain_files import check_database


class PublishedAdvisories(NamedTuple):
    """Revisions of one span."""

    open: list[AnyAdvisory]
    """Those open when the engine of the span starts."""
    decided: list[AnyAdvisory]
    """Every revision from then until the end of the span, in order."""


def published_in(store: Path, pending: PendingWrites, span: BoxSpan) -> PublishedAdvisories:
    """The revisions of advisories in the database and in `pending`, each once: pending ones may be stored by now.

    Raises `sqlite3.Error`.
    """
    check_database(store)
    with read_only(store) as db:
        stored_open = advisories_of(open_at(db, span.engine_s))
        stored = advisories_of(between(db, span.engine_s, span.until_s))
    last = stored[-1].seq if stored else 0
    unstored = [
        revision
        for revision in advisories_of(pending)
        if revision.seq > last and span.engine_s < revision.updated_at.timestamp() <= span.until_s
    ]
    return PublishedAdvisories(open_at_time(stored_open, advisories_of(pending), span.engine_s), [*stored, *unstored])
