"""Whether a vendor's connection is lost: if all of its robots fall silent at once, none of them has left."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import inf

UNHEARD_S = 2.5
"""The connection is lost if no robot of the vendor is heard for longer."""
FEWEST_ROBOTS = 4
"""The robots of a vendor with fewer may all have left at once."""


@dataclass(slots=True)
class VendorConnection:
    """When robots of one vendor were heard."""

    heard_s: float = -inf
    """When any of its robots was last heard."""
    robots: int = 0
    """How many are not silent."""
    lost_s: float = -inf
    """When the last loss of the connection began."""
    found_s: float = -inf
    """When that loss ended."""

    def record(self, now_s: float) -> None:
        """A robot of the vendor was heard."""
        if now_s > self.heard_s:
            if self.is_lost(now_s):
                self.lost_s, self.found_s = self.heard_s, now_s
            self.heard_s = now_s

    def is_lost(self, now_s: float) -> bool:
        """Whether the connection is lost now."""
        return self.robots >= FEWEST_ROBOTS and now_s - self.heard_s > UNHEARD_S

    def excused_s(self, heard_s: float, grace_s: float) -> float:
        """The part of the silence of a robot, last heard at `heard_s`, for which the connection was lost."""
        return self.found_s - self.lost_s if heard_s + grace_s >= self.lost_s and heard_s < self.found_s else 0.0


@dataclass(slots=True)
class VendorConnections:
    """The connections by vendor."""

    _connections: dict[str, VendorConnection] = field(default_factory=dict)
    _vendor_of: dict[str, str] = field(default_factory=dict)
    """Of the robots that are not silent."""

    def record(self, vendors: Iterable[str], arrivals_s: Iterable[float]) -> None:
        """Robots of these vendors were heard at these times."""
        newest: dict[str, float] = {}
        for vendor, arrival_s in zip(vendors, arrivals_s, strict=True):
            if arrival_s > newest.get(vendor, -inf):
                newest[vendor] = arrival_s
        for vendor, arrival_s in newest.items():
            self.of(vendor).record(arrival_s)

    def of(self, vendor: str) -> VendorConnection:
        """The connection of a vendor."""
        connection = self._connections.get(vendor)
        if connection is None:
            connection = self._connections[vendor] = VendorConnection()
        return connection

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
