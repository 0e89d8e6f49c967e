"""The learned state that engines of a cluster keep for each other, as an engine that starts reads it."""

import logging
from collections.abc import Mapping

from deconflict.runtime.learned_state import Part, UnreadableError, unpacked

log = logging.getLogger(__name__)


def kept_parts(name: str, kept: bytes | None, ended_early: str) -> dict[str, Part] | None:
    """The parts that are kept under a name. None if there are none, they can't be read, or the engine that went on with
    them `ended_early`. They stay as they are for engines of other releases, until this one keeps its own."""
    try:
        if kept and ended_early:
            raise UnreadableError(f"the engine that went on with it {ended_early}")
        return unpacked(kept) if kept else None
    except UnreadableError as error:
        log.warning("the learned state %r is left out, and learning begins anew: %s", name, error)
        return None


def log_set_aside(name: str, set_aside: Mapping[str, str]) -> None:
    """Name the parts with which an engine does not go on."""
    for part, reason in sorted(set_aside.items()):
        log.warning("the part %r of the learned state %r is set aside: %s; it is learned anew", part, name, reason)
