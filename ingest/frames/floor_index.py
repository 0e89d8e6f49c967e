"""The floors of batches: by which index each goes, and which of them a vendor's datum names."""

from collections import Counter

from ingest.frames.frame_registry import Frame, Frames

MOST_UNKNOWN = 50
"""Floors that one vendor may bring by naming datums that the site file does not have: each batch names them all."""
NOWHERE = -1
"""Floor index of a frame that is compared with nothing."""
Placed = tuple[Frame, int]
"""What a datum means, and the index of its floor."""


class Floors:
    """The floors that messages have named, in the order in which they first did."""

    def __init__(self, frames: Frames) -> None:
        self._frames = frames
        self._index: dict[str, int] = {}
        self._placed: dict[tuple[str, str], Placed] = {}
        """By vendor and datum, of what has a floor here."""
        self._made_up: Counter[str] = Counter()
        """Floors by the vendor that named their datum first, of those that the site file does not have."""

    @property
    def ids(self) -> tuple[str, ...]:
        """Of each floor, by index."""
        return tuple(self._index)

    def renew(self, frames: Frames) -> None:
        """What datums mean from now on; floors keep their indices."""
        self._frames = frames
        self._placed.clear()

    def of(self, vendor: str, datum: str) -> Placed:
        """What a vendor means by a datum."""
        key = vendor, datum
        return self._placed.get(key) or self._first(key)

    def named(self, vendor: str, own: str, datum: str) -> Placed:
        """The same as its robot names it that is on the datum `own`; "" is that."""
        key = vendor, datum or own
        return self._placed.get(key) or self._first(key)

    def _first(self, key: tuple[str, str]) -> Placed:
        vendor, datum = key
        frame = self._frames.frame(vendor, datum)
        if not frame.comparable:
            return frame, NOWHERE
        if frame.floor not in self._index:
            if not frame.known and self._made_up[vendor] >= MOST_UNKNOWN:
                return frame, NOWHERE
            self._made_up[vendor] += not frame.known
            self._index[frame.floor] = len(self._index)
        placed = self._placed[key] = frame, self._index[frame.floor]
        return placed
