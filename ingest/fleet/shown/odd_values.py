"""The values of a robot's messages that deviate, kept so that people can be told what to mend.

Bounded: a sender may make up paths without end.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

from ingest.languages import timestamps
from ingest.languages.rules import Oddity

MOST_KEPT = 20
"""Of a robot. Beyond it, the one that was received longest ago is left out."""
MOST_OF_VENDOR = 50
Oddities = tuple[Oddity, ...]


@dataclass(slots=True)
class OddValue:
    """One place in the messages of a robot where they deviate from a rule."""

    newest: Oddity
    count: int
    """How many messages had it."""
    last_s: float
    """When the newest of them arrived."""

    def document(self) -> dict[str, Any]:
        """JSON-ready."""
        return {**self.newest._asdict(), "count": self.count, "last_received": timestamps.write(self.last_s)}


class OddValues:
    """Those of one robot, by rule and path."""

    __slots__ = ("_by_place",)

    def __init__(self) -> None:
        self._by_place: dict[tuple[str, str], OddValue] = {}
        """That which was received longest ago first."""

    def note(self, oddities: Oddities, arrival_s: float) -> None:
        """Count the values of one message that deviate, each place once."""
        if not oddities:
            return
        for place, oddity in {(oddity.rule, oddity.anywhere): oddity for oddity in oddities}.items():
            known = self._by_place.pop(place, None)
            self._by_place[place] = OddValue(oddity._replace(path=place[1]), known.count + 1 if known else 1, arrival_s)
            if len(self._by_place) > MOST_KEPT:
                del self._by_place[next(iter(self._by_place))]

    def newest_first(self) -> list[OddValue]:
        return [*reversed(self._by_place.values())]


def by_vendor(robots: Iterable[tuple[str, list[OddValue]]]) -> dict[str, list[dict[str, Any]]]:
    """By vendor, what its robots send: as `OddValue.document`, with the number of `robots`; the most frequent first.

    `robots` has the vendor and the values of each robot. The value shown is the newest.
    """
    joined: dict[tuple[str, str, str], list[OddValue]] = {}
    for vendor, values in robots:
        for value in values:
            joined.setdefault((vendor, value.newest.rule, value.newest.path), []).append(value)
    documents: dict[str, list[dict[str, Any]]] = {}
    for (vendor, _, _), same in joined.items():
        newest = max(same, key=attrgetter("last_s"))
        summed = OddValue(newest.newest, sum(value.count for value in same), newest.last_s)
        documents.setdefault(vendor, []).append(summed.document() | {"robots": len(same)})
    for rows in documents.values():
        rows.sort(key=lambda row: (-row["robots"], -row["count"], row["rule"], row["path"]))
        del rows[MOST_OF_VENDOR:]
    return documents
