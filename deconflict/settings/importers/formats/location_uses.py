"""The use of a location, from the names of its type and operations."""

from deconflict.settings.importers.plan import Use

CHARGING = ("charg", "recharg")
"""Parts of names that mean charging."""
LOADING = ("load", "transfer", "goods", "storage", "drop", "pick")
"""Parts of names that mean loading or unloading."""


def use_of(description: str) -> Use:
    """The use of a location. `description` has the names of its type and operations."""
    description = description.casefold()
    if any(part in description for part in CHARGING):
        return "charger"
    return "dock" if any(part in description for part in LOADING) else "station"
