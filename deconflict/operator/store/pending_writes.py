"""Revisions that are numbered and told of, and not yet on the disk: a disk that fails or stalls silences nobody."""

from collections.abc import Iterable, Sequence

from deconflict.advisory import AdvisoryState, AnyAdvisory

MOST_AHEAD = 20_000
"""So many wait in memory for the disk; some 40 MB. What comes beyond is refused, and the engine offers it again."""
LOOK_BACK_S = 3600.0
"""An advisory that has not changed for this long is not looked for in the past."""

Ahead = Sequence[AnyAdvisory]
"""Ascending by number."""


def newest(ahead: Ahead) -> dict[str, AnyAdvisory]:
    """By advisory."""
    return {one.id: one for one in ahead}


def revisions(ahead: Ahead) -> dict[tuple[str, int], AnyAdvisory]:
    """By advisory and revision."""
    return {(one.id, one.revision): one for one in ahead}


def matches(one: AnyAdvisory, states: Iterable[int], kind: str | None, vendor: str | None, robot: str | None) -> bool:
    """Whether an advisory is one of those that a listing asks for; `states` has 1 for open and 0 for cleared."""
    return (
        int(one.state is not AdvisoryState.CLEARED) in states
        and kind in (None, one.kind)
        and (vendor is None or vendor in one.vendors)
        and (robot is None or robot in one.robots)
    )


def decided(ahead: Ahead, since_s: float, until_s: float) -> list[AnyAdvisory]:
    """Those that were decided in that time, both ends included."""
    return [one for one in ahead if since_s <= one.updated_at.timestamp() <= until_s]


def open_then(stored: Iterable[AnyAdvisory], ahead: Ahead, now_s: float) -> list[AnyAdvisory]:
    """What was open at a time, as far as the file told by then and by what was ahead of it."""
    known = {one.id: one for one in stored} | newest(decided(ahead, now_s - LOOK_BACK_S, now_s))
    return [one for one in known.values() if one.state is not AdvisoryState.CLEARED]
