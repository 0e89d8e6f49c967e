"""Loops that no error ends: each error is counted and logged, and the loop begins again."""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager

from ingest.measures.measures import Measures

FAULTS = "deconflict_faults_total"
AGAIN_S = 1.0
"""How long after an error a loop begins again."""

log = logging.getLogger(__name__)


async def lasting(part: str, loop: Callable[[], Awaitable[None]], measures: Measures) -> None:
    """Run a loop until it ends or is cancelled. `part` names it for people: "what does not work" while it fails."""
    while True:
        with going_on(part, measures):
            return await loop()
        await asyncio.sleep(AGAIN_S)


@contextmanager
def going_on(part: str, measures: Measures) -> Iterator[None]:
    """Go on after an error of this block."""
    try:
        yield
    except Exception:  # noqa: BLE001 - it is logged
        note_fault(part, measures)


def note_fault(part: str, measures: Measures) -> None:
    """Count the error that is being handled, and log it."""
    measures.count(FAULTS, part)
    log.exception("a fault of the program in %s, which should be reported; the service goes on", part)
