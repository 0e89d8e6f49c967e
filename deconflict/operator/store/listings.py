"""Which advisories or situations a listing has, and the pages of the stream: a bounded number of revisions at once."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import islice
from typing import Literal, NamedTuple

from deconflict_client.advisory import ADVISORY_KINDS, AdvisoryState
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
