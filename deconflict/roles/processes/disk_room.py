"""The room that a data directory takes: by robots and days, within the limits of the site file."""

from collections.abc import Iterator
from typing import NamedTuple

from deconflict.settings.site import Site

ROBOTS, DAYS = (10, 100, 1000), (1, 30, 365)
GB, DAY_H = 1e9, 24.0
LEAST_DAYS = 2.0
"""Less is written in hours."""


class KeptKind(NamedTuple):
    """One kind of data, which grows with robots and hours up to a limit."""

    name: str
    per_robot_hour: float
    """Bytes, as the demo with 60 robots writes them, where each reports once a second and many meet."""
    keep_days: float
    most_bytes: float

    def days(self, robots: int) -> float:
        """How far it reaches back."""
        return min(self.keep_days, self.most_bytes / (self.per_robot_hour * robots * DAY_H))

    def size(self, robots: int, days: float) -> float:
        """Bytes after these days."""
        return self.per_robot_hour * robots * DAY_H * min(days, self.days(robots))


def kept_kinds(site: Site) -> list[KeptKind]:
    """Learned state, owners and identities are left out: they take a few megabytes in all."""
    log, store, losses, boxes = site.recorder, site.store, site.losses, site.blackbox
    kinds = [
        KeptKind("advisories", 0.5e6, store.keep_days, store.advisories_bytes),
        KeptKind("lost time", 7e3, losses.keep_days, losses.most_bytes),
    ]
    if log.enabled:
        kinds.insert(0, KeptKind("log", 0.3e6, log.keep_days, log.total_bytes))
    if log.enabled and boxes.enabled:
        kinds.append(KeptKind("near misses", 1.2e6, boxes.keep_days, boxes.total_bytes))
    return kinds


def disk_lines(site: Site) -> Iterator[str]:
    """The table as text. A backup takes as much again."""
    kinds = kept_kinds(site)
    plain = 2 * site.recorder.segment_bytes if site.recorder.enabled else 0
    yield ""
    most_gb = (plain + sum(kind.most_bytes for kind in kinds)) / GB
    yield f"disk, if robots meet as often as in the demo; at most {most_gb:.1f} GB, and as much for each backup"
    names = "".join(f"{kind.name:>14}" for kind in kinds)
    yield f"  {'robots':>6}{''.join(f'{days:>7} d' for days in DAYS)}   reaches back:{names}"
    for robots in ROBOTS:
        sizes = (plain + sum(kind.size(robots, days) for kind in kinds) for days in DAYS)
        reach = "".join(f"{_span(kind.days(robots)):>14}" for kind in kinds)
        yield f"  {robots:>6}{''.join(f'{size / GB:>6.1f} GB' for size in sizes)}{' ' * 16}{reach}"


def _span(days: float) -> str:
    return f"{days:.0f} d" if days >= LEAST_DAYS else f"{days * DAY_H:.0f} h"
