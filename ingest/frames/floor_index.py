"""The floors of batches: the index of each, and which floor a vendor's datum names."""

from collections import Counter
from collections.abc import Sequence

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
        self._inhabited: set[str] = set()
        """Ids of floors on which a robot was, by its own location."""
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
        """The frame and floor that a vendor means by the datum of a robot's location."""
        key = vendor, datum
        placed = self._placed.get(key) or self._add(key)
        if placed[1] != NOWHERE:
            self._inhabited.add(placed[0].floor)
        return placed

    def of_own(self, vendor: str, own: str, datum: str) -> Placed:
        """The same of a place to which a robot on the datum `own` goes; "" means that datum too.

        A datum that the site does not have and no robot was ever on is another spelling of the robot's own.
        """
        frame = self._frames.frame(vendor, datum or own)
        if not (datum and self._is_nobodys(frame)):
            key = vendor, datum or own
            return self._placed.get(key) or self._add(key)
        return self.of_own(vendor, own, "")

    def misspelling(self, vendor: str, own: str, datums: Sequence[str]) -> str | None:
        """One of these datums that `of_own` takes for a spelling of the robot's own; None if there is none."""
        for datum in set(datums) - {"", own}:
            if self._is_nobodys(self._frames.frame(vendor, datum)):
                return datum
        return None

    def _is_nobodys(self, frame: Frame) -> bool:
        """Whether neither the site file nor the location of any robot has the floor of a frame."""
        return not frame.known and frame.floor not in self._inhabited

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
