"""Revisions that are numbered and published but not on disk yet. A disk that fails or stalls delays no advisory."""

from collections.abc import Iterable, Sequence

from deconflict.advisory import AdvisoryState, AnyAdvisory

MOST_PENDING = 20_000
"""If this many revisions wait in memory for the disk, some 40 MB, more are refused, and the engine sends them again."""
LOOK_BACK_S = 3600.0
"""A question about the past finds advisories that changed in this time before it."""

PendingWrites = Sequence[AnyAdvisory]
"""Ascending by number."""


def newest_by_id(pending: PendingWrites) -> dict[str, AnyAdvisory]:
    return {revision.id: revision for revision in pending}


def by_revision(pending: PendingWrites) -> dict[tuple[str, int], AnyAdvisory]:
    """By advisory id and revision."""
    return {(revision.id, revision.revision): revision for revision in pending}


def matches(
    advisory: AnyAdvisory, states: Iterable[int], kind: str | None, vendor: str | None, robot: str | None
) -> bool:
    """Whether an advisory passes the filters of a listing. `states` has 1 for open and 0 for cleared."""
    return (
        int(advisory.state is not AdvisoryState.CLEARED) in states
        and kind in (None, advisory.kind)
        and (vendor is None or vendor in advisory.vendors)
        and (robot is None or robot in advisory.robots)
    )


def decided_between(pending: PendingWrites, since_s: float, until_s: float) -> list[AnyAdvisory]:
    """The revisions decided between two times, both included."""
    return [revision for revision in pending if since_s <= revision.updated_at.timestamp() <= until_s]


def open_at_time(stored: Iterable[AnyAdvisory], pending: PendingWrites, now_s: float) -> list[AnyAdvisory]:
    """The advisories open at a time. `stored` are those that the file has as open then."""
    newest = {revision.id: revision for revision in stored}
    newest |= newest_by_id(decided_between(pending, now_s - LOOK_BACK_S, now_s))
    return [revision for revision in newest.values() if revision.state is not AdvisoryState.CLEARED]
