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
    named = [kind for kind in NOUNS if kind == "robot" or counts[kind]]
    return ", ".join(count_of(counts[kind], *NOUNS[kind]) for kind in named)
