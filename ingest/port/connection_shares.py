"""Who holds the connections of a port, and whose goes if there are too many.

The address, vendor or person with most connections loses its oldest one. So nobody keeps others out, however many
connections it opens.
"""

import asyncio
import ipaddress
from collections.abc import Hashable
from functools import lru_cache
from typing import Generic, TypeVar

Connection = TypeVar("Connection", bound=Hashable)
IPV6_SITE_BITS = 64
"""One machine may have any address with these first bits."""


class ConnectionShares(Generic[Connection]):
    """The open connections by holder."""

    def __init__(self) -> None:
        self._held: dict[str, dict[Connection, None]] = {}
        """By holder, oldest first."""
        self._holder: dict[Connection, str] = {}

    def __len__(self) -> int:
        return len(self._holder)

    def add(self, connection: Connection, holder: str) -> None:
        """Add a connection, or give it to another holder."""
        self.remove(connection)
        self._held.setdefault(holder, {})[connection] = None
        self._holder[connection] = holder

    def remove(self, connection: Connection) -> None:
        holder = self._holder.pop(connection, None)
        if holder is not None:
            same_holder = self._held[holder]
            del same_holder[connection]
            if not same_holder:
                del self._held[holder]

    def holder(self, connection: Connection) -> str | None:
        return self._holder.get(connection)

    def held(self, holder: str) -> int:
        """How many connections a holder has."""
        return len(self._held.get(holder, ()))

    def oldest(self, holder: str) -> Connection:
        """The oldest connection of a holder that has one."""
        return next(iter(self._held[holder]))

    def largest_holder(self) -> str:
        """The holder with most connections; there has to be one."""
        return max(self._held, key=lambda holder: len(self._held[holder]))


class Newcomers:
    """Accepted connections that have not shaken hands. Of too many, the address with most loses its oldest."""

    def __init__(self) -> None:
        self._shares: ConnectionShares[asyncio.Transport] = ConnectionShares()

    def __len__(self) -> int:
        return len(self._shares)

    def add(self, transport: asyncio.Transport) -> None:
        peer = transport.get_extra_info("peername")
        self._shares.add(transport, site_of(str(peer[0])) if peer else "")

    def remove(self, transport: asyncio.Transport) -> None:
        self._shares.remove(transport)

    def end_one(self) -> bool:
        """End one for another. False if there is none."""
        if not len(self._shares):
            return False
        oldest = self._shares.oldest(self._shares.largest_holder())
        self._shares.remove(oldest)
        oldest.abort()
        return True


@lru_cache(4096)
def site_of(address: str) -> str:
    """The address, or of an IPv6 address the network that one machine may choose it from."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if parsed.version == 4:
        return address
    mapped = parsed.ipv4_mapped
    return str(mapped or ipaddress.ip_network((parsed, IPV6_SITE_BITS), strict=False).network_address)


def holder_of(vendor: str | None, peer: str) -> str:
    """To whom a connection counts if there are too many."""
    return f"vendor {vendor}" if vendor else site_of(peer)
