"""The words of a revision: what happens as a headline, and with time and advice as a summary."""

from collections.abc import Callable
from typing import NamedTuple

from deconflict.advice.document_limits import MOST_HEADLINE_BYTES, MOST_SUMMARY_BYTES, short_text
from deconflict_client.advisory import NamedPlace

PAIR = 2


class Spot(NamedTuple):
    """Where something is, such as "in Aisle 3 on Ground hall"."""

    text: str
    places: tuple[NamedPlace, ...] = ()
    """Those that the text names."""


class RevisionWords(NamedTuple):
    """Fields of a revision, by their names."""

    headline: str
    summary: str


def words(sentence: Callable[[str], str], when: str = "", *more: str) -> RevisionWords:
    """`sentence(when)` is what happens then, and `sentence("")` the same without the time. The summary has `more`."""
    summary = "; ".join([sentence(when), *more])
    return RevisionWords(short_text(sentence(""), MOST_HEADLINE_BYTES), short_text(summary, MOST_SUMMARY_BYTES))


def each_waits(robots: int) -> str:
    """How so many robots lock each other."""
    return f"each waits for the {'next' if robots > PAIR else 'other'}"
