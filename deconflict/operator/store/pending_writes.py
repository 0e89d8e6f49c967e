"""Revisions that are numbered and published but not on disk yet. A disk that fails or stalls delays no advisory."""

import asyncio
import logging
from collections.abc import Callable, Iterable, Mapping, Sequence

from deconflict_client.advisory import AdvisoryState, ConflictAdvisory
from deconflict_client.situations import AnyRevision, Revision
from ingest.batch import Pair

MOST_PENDING = 20_000
"""If this many revisions wait in memory for the disk, some 40 MB, more are refused, and the engine sends them again."""
LOOK_BACK_S = 3600.0
"""A question about the past finds advisories that changed in this time before it."""

WAIT_S = 0.5
"""How long the first call of `DiskWork.do` waits for the disk."""

log = logging.getLogger(__name__)

PendingWrites = Sequence[AnyRevision]
"""Ascending by number."""


def newest_by_id(pending: Iterable[Revision]) -> dict[str, Revision]:
    return {revision.id: revision for revision in pending}


def by_revision(pending: Iterable[Revision]) -> dict[tuple[str, int], Revision]:
    """By advisory id and revision."""
    return {(revision.id, revision.revision): revision for revision in pending}


def decided_between(pending: Iterable[Revision], since_s: float, until_s: float) -> list[Revision]:
    """The revisions decided between two times, both included."""
    return [revision for revision in pending if since_s <= revision.updated_at.timestamp() <= until_s]


def with_encounters(
    numbers: Mapping[Pair, int], pending: Iterable[Revision], after: Pair, last: Pair | None
) -> dict[Pair, int]:
    """The last numbers of the encounters of pairs beyond `after` and up to `last`, also of those that wait."""
    found = dict(numbers)
    for revision in pending:
        if isinstance(revision, ConflictAdvisory) and after < revision.robots and (not last or revision.robots <= last):
            found[revision.robots] = max(revision.encounter, found.get(revision.robots, 0))
    return found


def open_at_time(stored: Iterable[Revision], pending: Iterable[Revision], now_s: float) -> list[Revision]:
    """The advisories open at a time. `stored` are those that the file has as open then."""
    newest = {revision.id: revision for revision in stored}
    newest |= newest_by_id(decided_between(pending, now_s - LOOK_BACK_S, now_s))
    return [revision for revision in newest.values() if revision.state is not AdvisoryState.CLEARED]


class DiskWork:
    """Work that waits for the disk, on one thread at a time. Nobody waits for it long, and only once if it is stuck."""

    def __init__(self, work: Callable[[], None]) -> None:
        self._work, self._is_due = work, False
        self._doing: asyncio.Task[None] | None = None

    async def do(self) -> None:
        """Have it done once from now on, at once or after what is being done."""
        self._is_due = True
        if self._doing is not None and not self._doing.done():
            return
        self._doing = asyncio.create_task(self._do())
        await asyncio.wait({self._doing}, timeout=WAIT_S)

    async def _do(self) -> None:
        while self._is_due:
            self._is_due = False
            try:
                await asyncio.to_thread(self._work)
            except Exception:
                log.exception("a file can't be written, by a fault of the program")

    async def settled(self, within_s: float) -> None:
        """Wait until all is done, or so long. Logs what is not."""
        if self._doing is None:
            return
        _, undone = await asyncio.wait({self._doing}, timeout=within_s)
        if undone:
            log.error("the disk does not answer within %g s: what was to be written last may be lost", within_s)
