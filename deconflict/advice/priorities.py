"""The weight of a second of each robot's waiting when advice chooses who should wait."""

from collections.abc import Iterable

from ingest.settings import Vendor

USUAL, OF_PEOPLE = 1.0, 10.0
"""Priority of robots, and of people, if the site does not set it."""
WEIGHT = 100
"""Solvers count priorities in hundredths."""


class Priorities:
    """Priorities of the site's vendors and their models; other vendors have the usual one."""

    def __init__(self, vendors: Iterable[Vendor]) -> None:
        self._vendors = {vendor.name: vendor for vendor in vendors}

    def of(self, vendor: str, model: str, *, on_foot: bool = False) -> float:
        """The model's priority, or else the vendor's, or else the usual one; that of people if it is `on_foot`."""
        settings = self._vendors.get(vendor)
        usual = OF_PEOPLE if on_foot else USUAL
        if settings is None:
            return usual
        of_model = settings.models[model].priority if model in settings.models else None
        priority = settings.priority if of_model is None else of_model
        return usual if priority is None else priority
