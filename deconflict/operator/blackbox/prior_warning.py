"""The warning of an event: the one rule by which reports and black boxes say that there was one, and how far ahead."""

from collections.abc import Iterable
from typing import NamedTuple

WITHIN_S = 10.0
"""What was cleared longer than this before an event was no warning of it."""


class OpenSpan(NamedTuple):
    """When an advisory was open, seconds since the epoch."""

    raised_s: float
    cleared_s: float
    """inf while it is open."""


def warning_before(spans: Iterable[OpenSpan], at_s: float) -> OpenSpan | None:
    """Of the advisories of a pair, the warning of an event that began at `at_s`; None if it was not warned of.

    One that is open at the event comes before a cleared one, and an earlier one before a later one.
    """
    before = (span for span in spans if span.raised_s <= at_s and span.cleared_s > at_s - WITHIN_S)
    return min(before, key=lambda span: (span.cleared_s <= at_s, span.raised_s), default=None)
