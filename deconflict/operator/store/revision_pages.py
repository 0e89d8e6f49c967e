"""Pages of revisions: of the kinds that a reader wants, a bounded number at once."""

from collections.abc import Iterable
from itertools import islice
from typing import NamedTuple

from deconflict.advisories.situations.situation import AnyRevision

MOST_SCANNED = 5_000
"""Most revisions that one page goes through."""


class Page(NamedTuple):
    """Revisions of some kinds, ascending by number."""

    revisions: list[AnyRevision]
    last: int
    """Up to this number these are all."""


def first_page(rows: Iterable[tuple[int, AnyRevision | None]], after: int, limit: int) -> Page:
    """Up to `limit` revisions of numbers above `after`. A number without a revision is not wanted."""
    found: list[AnyRevision] = []
    last = after
    for number, revision in islice(rows, MOST_SCANNED):
        last = number
        if revision:
            found.append(revision)
        if len(found) == limit:
            break
    return Page(found, last)
