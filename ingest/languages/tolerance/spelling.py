"""Words and keys that are spelt otherwise than the standard spells them."""

from difflib import get_close_matches
from functools import lru_cache

MOST_LETTERS = 80
LEAST_ALIKE = 0.75
"""Share of the letters of two keys that agree, if one may be meant for the other."""
_CACHED = 4096
PLACE_NAMES = "position", "pose", "currentposition", "currentpose", "currentlocation", "robotposition", "robotpose"
"""Keys, folded, under which senders say where a robot is, whatever the standard calls it."""


def folded(text: str) -> str:
    """Its letters and digits, whatever the case. Of a long text only the beginning counts, and is kept."""
    return _folded(text[:MOST_LETTERS])


def nearest(key: str, known: frozenset[str]) -> str:
    """The known key that is spelt most like it, case and underscores aside. "" if none is alike."""
    return _nearest(key[:MOST_LETTERS], known)


@lru_cache(_CACHED)
def _folded(text: str) -> str:
    return "".join(filter(str.isalnum, text)).casefold()


@lru_cache(_CACHED)
def _nearest(key: str, known: frozenset[str]) -> str:
    by_folded = {folded(each): each for each in known}
    alike = get_close_matches(folded(key), by_folded, 1, LEAST_ALIKE)
    return by_folded[alike[0]] if alike else ""
