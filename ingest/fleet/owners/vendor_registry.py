"""The vendors of the site, and those that identity reports name."""

from collections.abc import Sequence
from functools import lru_cache

from ingest.languages.visible_text import visible
from ingest.measures.measures import OTHER
from ingest.settings import UNKNOWN, Model, Vendor

MAX_UNCONFIGURED = 64
"""Vendors kept that the site file does not have."""
MAX_NAME = 40
"""Characters kept of a manufacturer's name."""
_PLAIN_MODEL = Model()


@lru_cache(MAX_UNCONFIGURED)
def _default_settings(name: str) -> Vendor:
    return Vendor(name=name)


class VendorRegistry:
    """Finds vendors by manufacturer and by robot.

    Vendor names are label values of metrics, so the number of vendors that the site file does not have is limited: the
    first `MAX_UNCONFIGURED` keep their own names, later ones share `OTHER`.
    """

    def __init__(self, vendors: Sequence[Vendor]) -> None:
        self._configured = {vendor.name: vendor for vendor in vendors}
        self._by_manufacturer = {
            manufacturer.casefold(): vendor.name
            for vendor in vendors
            for manufacturer in (vendor.name, *vendor.manufacturers)
        }
        self._by_robot = {uuid.lower(): vendor.name for vendor in vendors for uuid in vendor.robots}
        self._unconfigured: dict[str, Vendor] = {}
        """By name, vendors that only identity reports name."""

    def configured(self, name: str) -> bool:
        """Whether the site file has this vendor."""
        return name in self._configured

    def of_manufacturer(self, manufacturer: str) -> str:
        """The vendor's name for a `manufacturerName` of an identity report."""
        known = self._by_manufacturer.get(manufacturer.strip().casefold())
        if known:
            return known
        name = visible(manufacturer.strip())[:MAX_NAME] or UNKNOWN
        if name in self._unconfigured:
            return name
        if len(self._unconfigured) >= MAX_UNCONFIGURED:
            return OTHER
        self._unconfigured[name] = Vendor(name=name)
        return name

    def settled_name(self, name: str, *, was_configured: bool) -> str | None:
        """What a vendor of earlier settings is called now. None if the site file named it and does so no longer."""
        known = name if name in self._configured else self._by_manufacturer.get(name.casefold())
        return known or (None if was_configured else name)

    def of_robot(self, uuid: str) -> str | None:
        """The vendor to which the site file assigns the robot. None if to none."""
        return self._by_robot.get(uuid)

    def problem_of_giving(self, uuid: str, vendor: str) -> str:
        """Why the robot can't be given to the vendor by a person; "" if it can."""
        if vendor not in self._configured and vendor not in self._unconfigured:
            return f"vendor: {vendor!r} is in no site file and no robot here has named it"
        assigned = self.of_robot(uuid)
        return f"the site file gives the robot to {assigned}; change vendors.robots there" if assigned else ""

    def settings(self, name: str) -> Vendor:
        return self._configured.get(name) or self._unconfigured.get(name) or _default_settings(name)

    def model(self, vendor: str, model: str) -> Model:
        return self.settings(vendor).models.get(model) or _PLAIN_MODEL
