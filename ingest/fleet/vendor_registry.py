"""Which vendor a robot belongs to, and what the site says of that vendor."""

from collections.abc import Sequence
from functools import lru_cache

from ingest.settings import UNKNOWN, Model, Vendor

OTHER = "other"
MAX_UNCONFIGURED = 64
MAX_NAME = 40
_PLAIN_MODEL = Model()


@lru_cache(MAX_UNCONFIGURED)
def _unheard_of(name: str) -> Vendor:
    return Vendor(name=name)


class Vendors:
    """The site's vendors, and those that only identity reports name.

    Vendor names are label values of metrics, so those the site does not know are bounded: the first
    `MAX_UNCONFIGURED` keep their own names, later ones share `OTHER`.
    """

    def __init__(self, vendors: Sequence[Vendor]) -> None:
        self._configured = {vendor.name: vendor for vendor in vendors}
        self._by_manufacturer = {
            manufacturer.casefold(): vendor.name
            for vendor in vendors
            for manufacturer in (vendor.name, *vendor.manufacturers)
        }
        self._by_robot = {uuid.lower(): vendor.name for vendor in vendors for uuid in vendor.robots}
        self._met: dict[str, Vendor] = {}

    def configured(self, name: str) -> bool:
        """Whether the site file has this vendor."""
        return name in self._configured

    def of_manufacturer(self, manufacturer: str) -> str:
        known = self._by_manufacturer.get(manufacturer.strip().casefold())
        if known:
            return known
        name = manufacturer.strip()[:MAX_NAME] or UNKNOWN
        if name in self._met or len(self._met) < MAX_UNCONFIGURED:
            self._met.setdefault(name, Vendor(name=name))
            return name
        return OTHER

    def of_robot(self, uuid: str) -> str | None:
        """The vendor that the site file gives this robot to."""
        return self._by_robot.get(uuid)

    def settings(self, name: str) -> Vendor:
        return self._configured.get(name) or self._met.get(name) or _unheard_of(name)

    def model(self, vendor: str, model: str) -> Model:
        return self.settings(vendor).models.get(model) or _PLAIN_MODEL
