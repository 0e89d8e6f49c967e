"""Which vendor each robot belongs to, also of robots that are silent: it outlasts the fleet's memory and a restart."""

import json
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

from ingest.fleet.owners.vendor_registry import VendorRegistry

FORMAT = 1
MOST_OWNED = 40_000
"""Robots kept of one vendor, and of all together that the site file does not name. Beyond, those that were entered
longest ago are forgotten, and counted."""


class OwnerRegister:
    """Robots by vendor. Only robots whose vendor is settled are entered."""

    def __init__(self, configured: Callable[[str], bool]) -> None:
        """`configured` says whether the site file names a vendor."""
        self._configured = configured
        self._owners: dict[str, str] = {}
        """The vendor by UUID."""
        self._robots: dict[str, OrderedDict[str, None]] = {}
        """The UUIDs by vendor, those entered longest ago first."""
        self._of_others: OrderedDict[str, None] = OrderedDict()
        """Those of all vendors together that the site file does not name."""
        self.changes = 0
        """Grows with each change."""
        self.forgotten: dict[str, int] = {}
        """By vendor, how many robots were forgotten for lack of room."""

    def owner(self, uuid: str) -> str | None:
        return self._owners.get(uuid)

    def enter(self, uuid: str, vendor: str) -> None:
        """Enter the owner of a robot, or another one. It counts as entered now."""
        if self._owners.get(uuid) != vendor:
            self._remove(uuid)
            self._owners[uuid] = vendor
            self._robots.setdefault(vendor, OrderedDict())[uuid] = None
            self.changes += 1
        sharing = self._robots[vendor]
        sharing.move_to_end(uuid)
        if not self._configured(vendor):
            sharing = self._of_others
            sharing[uuid] = None
            sharing.move_to_end(uuid)
        if len(sharing) > MOST_OWNED:
            self._forget(next(iter(sharing)))

    def _forget(self, uuid: str) -> None:
        """Forget a robot for lack of room."""
        vendor = self._owners[uuid]
        self._remove(uuid)
        self.forgotten[vendor] = self.forgotten.get(vendor, 0) + 1

    def settle(self, rename: Callable[[str], str | None]) -> None:
        """Give the robots of each vendor to the vendor that `rename` returns, or to nobody if that is None."""
        for vendor in list(self._robots):
            if (renamed := rename(vendor)) != vendor:
                for uuid in list(self._robots[vendor]):
                    if renamed:
                        self.enter(uuid, renamed)
                    else:
                        self._remove(uuid)
            elif self._configured(vendor):
                for uuid in self._robots[vendor]:
                    self._of_others.pop(uuid, None)

    def _remove(self, uuid: str) -> None:
        owner = self._owners.pop(uuid, None)
        if owner is not None:
            self._of_others.pop(uuid, None)
            del self._robots[owner][uuid]
            if not self._robots[owner]:
                del self._robots[owner]
            self.changes += 1

    def document(self, vendors: VendorRegistry) -> dict[str, Any]:
        """As the file has it. `vendors` says which of the owners the site file names."""
        configured = sorted(filter(vendors.configured, self._robots))
        named = [uuid for robots in self._robots.values() for uuid in robots if uuid not in self._of_others]
        owners = [(uuid, self._owners[uuid]) for uuid in (*named, *self._of_others)]
        return {"format": FORMAT, "configured": configured, "owners": owners}

    def read(self, data: bytes, vendors: VendorRegistry) -> None:
        """Enter what `document` gave under another site file, perhaps. Raises `ValueError` if it is something else."""
        try:
            document = json.loads(data)
            if document["format"] != FORMAT:
                raise ValueError(f"format {document['format']!r} is not {FORMAT}")
            owners = [(str(uuid), str(vendor)) for uuid, vendor in document["owners"]]
            configured = frozenset(map(str, document["configured"]))
        except (KeyError, TypeError, RecursionError) as error:
            raise ValueError(f"it is no register of owners ({type(error).__name__}: {error})") from error
        for uuid, vendor in owners:
            if settled := vendors.settled_name(vendor, was_configured=vendor in configured):
                self.enter(uuid, settled)
