"""The floors of batches: the index of each, and which floor a vendor's datum names."""

from collections import Counter

from ingest.frames.frame_registry import Frame, FrameRegistry

MOST_UNKNOWN = 50
"""Floors that one vendor may add by naming datums that the site file does not have. Each batch names all floors."""
NOWHERE = -1
"""Floor index of a frame that is compared with nothing."""
Placed = tuple[Frame, int]
"""The frame that a datum means, and the index of its floor."""


class FloorIndex:
    """The floors that messages have named, in the order in which they were first named."""

    def __init__(self, frames: FrameRegistry) -> None:
        self._frames = frames
        self._index: dict[str, int] = {}
        self._placed: dict[tuple[str, str], Placed] = {}
        """By vendor and datum, for floors that have an index."""
        self._unknown: Counter[str] = Counter()
        """By vendor, how many floors it named first that the site file does not have."""

    @property
    def ids(self) -> tuple[str, ...]:
        """The id of each floor, by index."""
        return tuple(self._index)

    def reconfigure(self, frames: FrameRegistry) -> None:
        """Use other frames from now on. Floors keep their indices."""
        self._frames = frames
        self._placed.clear()

    def of(self, vendor: str, datum: str) -> Placed:
        """The frame and floor that a vendor means by a datum."""
        key = vendor, datum
        return self._placed.get(key) or self._add(key)

    def of_own(self, vendor: str, own: str, datum: str) -> Placed:
        """The same for a robot on the datum `own`, which "" means too."""
        key = vendor, datum or own
        return self._placed.get(key) or self._add(key)

    def _add(self, key: tuple[str, str]) -> Placed:
        vendor, datum = key
        frame = self._frames.frame(vendor, datum)
        if not frame.comparable:
            return frame, NOWHERE
        if frame.floor not in self._index:
            if not frame.known and self._unknown[vendor] >= MOST_UNKNOWN:
                return frame, NOWHERE
            self._unknown[vendor] += not frame.known
            self._index[frame.floor] = len(self._index)
        placed = self._placed[key] = frame, self._index[frame.floor]
        return placed
