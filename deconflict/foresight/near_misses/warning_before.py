"""Which advisory warned of an event of two robots, and how long before: one rule for boxes, reports and scores."""

from collections.abc import Iterable
from math import inf
from typing import NamedTuple, Protocol, TypeVar

from deconflict_client.advisory import AdvisoryState, ConflictAdvisory
from ingest.batch import Pair

WITHIN_S = 10.0
"""An advisory that was cleared longer than this before an event did not warn of it."""


class Stood(Protocol):
    """An advisory from raised to cleared."""

    @property
    def raised_s(self) -> float: ...

    @property
    def cleared_s(self) -> float: ...


S = TypeVar("S", bound=Stood)


class StoodAdvisory(NamedTuple):
    """An advisory of a pair."""

    id: str
    raised_s: float
    cleared_s: float
    """inf while it is open."""


class Lead(NamedTuple):
    """How long before an event its advisory was raised and, if it was no longer open then, cleared."""

    raised_s: float
    cleared_s: float | None


def warning_before(advisories: Iterable[S], began_s: float) -> S | None:
    """Of the advisories of a pair, the one that warned of an event; None if it was not warned of.

    One that is open when the event begins comes before cleared ones, and an earlier one before later ones.
    """
    before = (each for each in advisories if each.raised_s <= began_s and each.cleared_s > began_s - WITHIN_S)
    return min(before, key=lambda each: (each.cleared_s <= began_s, each.raised_s), default=None)


def lead_of(warning: Stood | None, began_s: float) -> Lead | None:
    """The lead of the advisory that warned of an event; None without one."""
    if warning is None:
        return None
    cleared_s = warning.cleared_s
    return Lead(began_s - warning.raised_s, began_s - cleared_s if cleared_s <= began_s else None)


def stood_advisories(revisions: Iterable[ConflictAdvisory], pair: Pair) -> list[StoodAdvisory]:
    """The advisories of a pair, by their revisions in the order of time."""
    newest = {revision.id: revision for revision in revisions if revision.robots == pair}
    return [
        StoodAdvisory(
            each.id,
            each.raised_at.timestamp(),
            each.updated_at.timestamp() if each.state is AdvisoryState.CLEARED else inf,
        )
        for each in newest.values()
    ]
