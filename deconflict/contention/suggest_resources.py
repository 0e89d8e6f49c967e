"""`deconflict site suggest LOG`: resources where robots of any vendor keep standing, as TOML to paste."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import ceil, floor
from pathlib import Path
from statistics import median

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from deconflict.contention.robots.announced_arrivals import near
from deconflict.contention.robots.place_geometry import Geometry
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.importers.plan_reader import section_lines
from deconflict.settings.shared_places import Resource
from deconflict.settings.site import Site
from ingest.batch import Batch
from ingest.measures.measures import Measures
from ingest.recording.log_reader import LogReader, Received, by_time

DWELL_S = 10.0
"""A robot that stands for less than this only pauses."""
STANDS_M = 0.2
SAME_M = 0.6
"""Dwells no further apart than this are at one place."""
FEWEST = 3
"""Dwells that make a place."""
LOOK_S = 1.0
HEAD = """\
# Where robots kept standing in {logs}: {dwells} stops of {least:g} s or longer, {places} places with {fewest} or more.
# Set right the kind, the name and the outline of each, and give one group to those that can stand in for each other.
"""


@dataclass(frozen=True, slots=True)
class Dwell:
    """One robot's stop."""

    vendor: str
    datum: str
    x_m: float
    y_m: float
    size_m: float
    """The longer side of its envelope."""
    dwell_s: float
    states: tuple[str, ...]


@dataclass(slots=True)
class _Stand:
    """A robot that has not moved since it came."""

    spot: tuple[str, float, float]
    came_s: float
    last_s: float
    vendor: str
    size_m: float
    states: Counter[str]

    def dwell(self) -> Dwell:
        return Dwell(self.vendor, *self.spot, self.size_m, self.last_s - self.came_s, tuple(self.states.elements()))


def suggested(logs: Iterable[Path], site: Site) -> str:
    """Resources that the site file does not have yet, those with most stops first."""
    logs = list(logs)
    found = list(dwells(logs, site))
    places = [one for one in clusters(found) if not _known(one, Geometry(site.resources, ()))]
    told = ", ".join(path.name for path in logs)
    head = HEAD.format(logs=told, dwells=len(found), least=DWELL_S, places=len(places), fewest=FEWEST)
    lines = [head.rstrip("\n")]
    for number, members in enumerate(places, 1):
        first, *keys = section_lines("resources", _resource(number, members))
        vendors = ", ".join(sorted({one.vendor for one in members}))
        stay_s = median(one.dwell_s for one in members)
        lines += [f"\n# {len(members)} stops of {vendors}, {stay_s:.0f} s in the middle", first.lstrip("\n"), *keys]
    return "\n".join(lines) + "\n"


def dwells(logs: Iterable[Path], site: Site) -> Iterator[Dwell]:
    """Every stop in the logs; one that the log's end cuts off too."""
    fleet, standing, cut_s = fleet_of(site, Measures()), dict[str, _Stand](), 0.0
    for event in LogReader().read(by_time(logs)):
        if not isinstance(event, Received) or event.refused:
            continue
        fleet.receive(event.raw, event.arrival_s, event.connection)
        if event.arrival_s - cut_s >= LOOK_S:
            cut_s = event.arrival_s
            yield from _ended(standing, fleet.next_batch(cut_s))
    yield from _ended(standing, fleet.next_batch(cut_s))
    yield from _long(stand.dwell() for stand in standing.values())


def _ended(standing: dict[str, _Stand], batch: Batch) -> Iterator[Dwell]:
    """Take in where robots are; the stops that this ends."""
    sizes, start = batch.forecasts, batch.forecasts.start
    for row, (uuid, datum) in enumerate(zip(batch.robots, batch.datums(sizes.floor[start[:-1]]), strict=True)):
        knot, event_s = int(start[row]), float(batch.event_s[row])
        spot = datum, float(sizes.x_m[knot]), float(sizes.y_m[knot])
        before = standing.get(uuid)
        if before and near(before.spot, spot, STANDS_M):
            before.last_s = event_s
            before.states[batch.states[row]] += 1
            continue
        if before:
            yield from _long([before.dwell()])
        size_m = float(max(sizes.length_m[row], sizes.width_m[row]))
        states = Counter([batch.states[row]])
        standing[uuid] = _Stand(spot, event_s, event_s, batch.vendors[row], size_m, states)


def _long(found: Iterable[Dwell]) -> Iterator[Dwell]:
    return (one for one in found if one.dwell_s >= DWELL_S and one.datum)


def clusters(found: Sequence[Dwell]) -> list[list[Dwell]]:
    """Stops at one place, where there are enough of them; the places with most stops first."""
    places: list[list[Dwell]] = []
    for datum in sorted({one.datum for one in found}):
        here = [one for one in found if one.datum == datum]
        pairs = cKDTree([(one.x_m, one.y_m) for one in here]).query_pairs(SAME_M, output_type="ndarray")
        joined = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(here), len(here)))
        _, labels = connected_components(joined, directed=False)
        groups: dict[int, list[Dwell]] = {}
        for label, one in zip(labels.tolist(), here, strict=True):
            groups.setdefault(label, []).append(one)
        places += [group for group in groups.values() if len(group) >= FEWEST]
    return sorted(places, key=lambda group: (-len(group), group[0].datum, group[0].x_m, group[0].y_m))


def _resource(number: int, members: Sequence[Dwell]) -> Resource:
    """A rectangle around the stops, half an envelope wider on every side, to the decimetre."""
    x, y = [one.x_m for one in members], [one.y_m for one in members]
    margin_m = max(one.size_m for one in members) / 2
    west, south = floor(10 * (min(x) - margin_m)) / 10, floor(10 * (min(y) - margin_m)) / 10
    east, north = ceil(10 * (max(x) + margin_m)) / 10, ceil(10 * (max(y) + margin_m)) / 10
    state, _ = Counter(state for one in members for state in one.states).most_common(1)[0]
    return Resource(
        id=f"place-{number}",
        kind="charger" if state == "charging" else "parking" if state == "idle" else "dock",
        datum=members[0].datum,
        polygon=((west, south), (east, south), (east, north), (west, north)),
    )


def _known(members: Sequence[Dwell], geometry: Geometry) -> bool:
    """Whether most of these stops are in a resource of the site already."""
    x_m, y_m = np.array([one.x_m for one in members]), np.array([one.y_m for one in members])
    inside = geometry.resources_at([one.datum for one in members], x_m, y_m)
    return sum(one is not None for one in inside) > len(members) / 2
