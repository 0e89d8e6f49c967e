"""Parts of the service that a comparison switches off one by one: a name, and what it changes in a new engine."""

from collections.abc import Callable, Mapping

from deconflict.engine import Engine

Change = Callable[[Engine], None]

PARTS: Mapping[str, Change] = {}


def unchanged(_engine: Engine) -> None:
    """The service as it is."""
