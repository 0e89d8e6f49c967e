"""What a device on the floor stands for."""

from collections import Counter
from collections.abc import Iterable
from typing import Literal

from deconflict_client.counted_nouns import count_of

ParticipantKind = Literal["robot", "person", "driven"]
"""A robot, a person on foot, or a vehicle with a driver."""
NOUNS: dict[ParticipantKind, tuple[str, str]] = {
    "robot": ("robot", "robots"),
    "person": ("person", "people"),
    "driven": ("driven vehicle", "driven vehicles"),
}
"""One of each kind, and several."""


def counted(kinds: Iterable[ParticipantKind]) -> str:
    """How many robots, people and driven vehicles there are: "45 robots, 15 people, 4 driven vehicles"."""
    counts = Counter(kinds)
    return ", ".join(_counts(counts, ["robot", *(kind for kind in counts if kind != "robot")]))


def counted_in_words(kinds: Iterable[ParticipantKind]) -> str:
    """The same as part of a sentence, without kinds of which there is none: "1 robot and 2 people"."""
    *others, last = _counts(counts := Counter(kinds), counts)
    return " and ".join(filter(None, [", ".join(others), last]))


def _counts(counts: Counter[ParticipantKind], named: Iterable[ParticipantKind]) -> list[str]:
    """In the order of `NOUNS`."""
    return [count_of(counts[kind], *NOUNS[kind]) for kind in sorted(named, key=[*NOUNS].index)]
