"""The use of a location, from the names of its type and operations."""

from deconflict.settings.importers.plan import Use

CHARGING = ("charg", "recharg")
"""Parts of names that mean charging."""
LOADING = ("load", "transfer", "goods", "storage", "drop", "pick")
"""Parts of names that mean loading or unloading."""
PARKING = ("park",)
"""Parts of names that mean waiting for work."""


def use_of(*descriptions: str) -> Use:
    """The use of a location. Each description has names of its type and operations; the first that tells decides."""
    return next(filter(None, map(_told_use, descriptions)), "station")


def _told_use(description: str) -> Use | None:
    description = description.casefold()
    if any(part in description for part in CHARGING):
        return "charger"
    if any(part in description for part in LOADING):
        return "dock"
    return "parking" if any(part in description for part in PARKING) else None
