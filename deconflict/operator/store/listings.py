"""Which advisories or situations a listing or a shift has, and the pages of the stream: a bounded number at once."""

import sqlite3
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import islice
from typing import Literal, NamedTuple

from deconflict_client.advisory import ADVISORY_KINDS, AdvisoryState, SituationKind
from deconflict_client.situations import AnyRevision

StateFilter = Literal["open", "cleared", "all"]

MOST_SCANNED = 5_000
"""Most revisions that one page goes through."""
OPEN_VALUES: dict[StateFilter, tuple[int, ...]] = {"open": (1,), "cleared": (0,), "all": (0, 1)}


@dataclass(frozen=True, slots=True)
class ListingFilter:
    """Where a field is None, any value will do."""

    state: StateFilter = "open"
    kind: str | None = None
    """None for any kind of advisory, without situations and advice."""
    situation_kind: str | None = None
    severity: str | None = None
    vendor: str | None = None
    robot: str | None = None

    def matches(self, revision: AnyRevision) -> bool:
        return (
            int(revision.state is not AdvisoryState.CLEARED) in OPEN_VALUES[self.state]
            and (revision.kind == self.kind if self.kind else revision.kind in ADVISORY_KINDS)
            and self.situation_kind in (None, getattr(revision, "situation_kind", None))
            and self.severity in (None, revision.severity)
            and (self.vendor is None or self.vendor in revision.vendors)
            and (self.robot is None or self.robot in revision.robots)
        )


class Page(NamedTuple):
    """Revisions of some kinds, ascending by number."""

    revisions: list[AnyRevision]
    last: int
    """Up to this number these are all that are stored."""
    removed: int
    """The highest number of one of these kinds that was removed."""


def first_page(rows: Iterable[tuple[int, AnyRevision | None]], after: int, limit: int, removed: int) -> Page:
    """Up to `limit` revisions of numbers above `after`. A number without a revision is not wanted. `removed` as of
    `Page`."""
    found: list[AnyRevision] = []
    last = after
    for number, revision in islice(rows, MOST_SCANNED):
        last = number
        if revision:
            found.append(revision)
        if len(found) == limit:
            break
    return Page(found, last, removed)


class ShiftRow(NamedTuple):
    """A situation of a shift."""

    id: str
    first_kind: SituationKind
    document: str
    """Its newest revision."""
    worst_severity: str
    most_cost_s: float


def situations_since(db: sqlite3.Connection, since_s: float, limit: int) -> list[ShiftRow]:
    """Situations that changed since a time, newest first."""
    rows = db.execute(
        """SELECT a.id, (SELECT f.document ->> '$.situation_kind' FROM revisions AS f WHERE f.id = a.id ORDER BY f.seq),
            newest.document, max(CASE r.document ->> '$.severity'
            WHEN 'critical' THEN 2 WHEN 'warning' THEN 1 ELSE 0 END), max(r.document ->> '$.cost_s')
        FROM advisories AS a JOIN revisions AS newest ON newest.seq = a.seq JOIN revisions AS r ON r.id = a.id
        WHERE a.kind = 'situation' AND a.updated_s >= ? GROUP BY a.id ORDER BY a.seq DESC LIMIT ?""",
        (since_s, limit),
    )
    severities = ("caution", "warning", "critical")
    return [ShiftRow(name, kind, document, severities[worst], cost_s) for name, kind, document, worst, cost_s in rows]
