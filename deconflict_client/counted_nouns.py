"""Counts with their nouns, for people."""


def count_of(count: int, noun: str, plural: str = "") -> str:
    """ "1 robot", "1,200 robots", "0 boxes". `plural` is the noun of several, if it is not the noun with an s."""
    return f"{count:,} {noun if count == 1 else plural or f'{noun}s'}"
