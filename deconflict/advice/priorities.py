"""What a second of each robot's waiting counts when advice weighs who should wait."""

from collections.abc import Iterable

from ingest.settings import Vendor

USUAL, OF_PEOPLE = 1.0, 10.0


class Priorities:
    """Of the site's vendors and their models; robots of other vendors count as usual."""

    def __init__(self, vendors: Iterable[Vendor]) -> None:
        self._vendors = {one.name: one for one in vendors}

    def of(self, vendor: str, model: str) -> float:
        """The model's, else the vendor's, else the usual one."""
        said = self._vendors.get(vendor)
        if said is None:
            return USUAL
        by_model = said.models[model].priority if model in said.models else None
        given = said.priority if by_model is None else by_model
        if given is not None:
            return given
        return OF_PEOPLE if said.participant == "person" else USUAL
