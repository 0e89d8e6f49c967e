"""Whether a vendor's connection is lost: where all of its robots fall silent at once, none of them has left."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import inf

LOST_S = 2.5
"""Nobody of a vendor is heard for longer."""
FEWEST_ROBOTS = 4
"""Of a vendor with fewer robots they may all have left at once."""


@dataclass(slots=True)
class VendorConnection:
    """What is heard of one vendor."""

    heard_s: float = -inf
    """When any of its robots was heard last."""
    robots: int = 0
    """Those that are not silent."""
    lost_s: float = -inf
    found_s: float = -inf
    """From when to when the connection was lost, the last time that it was."""

    def record(self, now_s: float) -> None:
        if now_s > self.heard_s:
            if self.is_lost(now_s):
                self.lost_s, self.found_s = self.heard_s, now_s
            self.heard_s = now_s

    def is_lost(self, now_s: float) -> bool:
        return self.robots >= FEWEST_ROBOTS and now_s - self.heard_s > LOST_S

    def excused_s(self, heard_s: float, grace_s: float) -> float:
        """For how much of its silence a robot that was heard last at `heard_s` could not be heard."""
        return self.found_s - self.lost_s if heard_s + grace_s >= self.lost_s and heard_s < self.found_s else 0.0


@dataclass(slots=True)
class VendorConnections:
    """By vendor."""

    _contacts: dict[str, VendorConnection] = field(default_factory=dict)
    _vendor_of: dict[str, str] = field(default_factory=dict)
    """By robot that is not silent."""

    def record(self, vendors: Iterable[str], arrivals_s: Iterable[float]) -> None:
        """Robots of these vendors were heard."""
        newest: dict[str, float] = {}
        for vendor, arrival_s in zip(vendors, arrivals_s, strict=True):
            if arrival_s > newest.get(vendor, -inf):
                newest[vendor] = arrival_s
        for vendor, arrival_s in newest.items():
            self.of(vendor).record(arrival_s)

    def of(self, vendor: str) -> VendorConnection:
        found = self._contacts.get(vendor)
        if found is None:
            found = self._contacts[vendor] = VendorConnection()
        return found

    def join(self, uuid: str, vendor: str) -> None:
        """A robot is heard from now on."""
        self.leave(uuid)
        self._vendor_of[uuid] = vendor
        self.of(vendor).robots += 1

    def leave(self, uuid: str) -> None:
        """A robot is silent, or forgotten."""
        vendor = self._vendor_of.pop(uuid, None)
        if vendor is not None:
            self.of(vendor).robots -= 1
