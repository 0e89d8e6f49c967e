"""What the engine had told as a black box begins, and what it told in its time."""

from pathlib import Path
from typing import NamedTuple

from deconflict.advisory import AnyAdvisory
from deconflict.operator.blackbox.blackbox_request import Span
from deconflict.operator.store.pending_writes import Ahead, open_then
from deconflict.operator.store.tables import between, for_reading, open_at


class Told(NamedTuple):
    """Revisions of one span."""

    open: list[AnyAdvisory]
    """What was open when its engine began."""
    decided: list[AnyAdvisory]
    """Everything from then on until its end, in order."""


def told_in(store: Path, waiting: Ahead, span: Span) -> Told:
    """What the file tells, and what `waiting` had of it; that may be stored by now. Raises `sqlite3.Error`."""
    with for_reading(store) as db:
        then, stored = open_at(db, span.engine_s), between(db, span.engine_s, span.until_s)
    last = stored[-1].seq if stored else 0
    late = [one for one in waiting if one.seq > last and span.engine_s < one.updated_at.timestamp() <= span.until_s]
    return Told(open_then(then, waiting, span.engine_s), [*stored, *late])
