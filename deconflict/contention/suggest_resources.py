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
from deconflict.contention.robots.place_geometry import PlaceGeometry
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
"""A robot that has moved no farther than this stands."""
SAME_M = 0.6
"""Dwells no farther apart than this are at one place."""
FEWEST = 3
"""This many dwells make a place."""
LOOK_S = 1.0
HEAD = """\
# Where robots kept standing in {logs}: {dwells} stops of {least:g} s or longer, {places} places with {fewest} or more.
# Correct the kind, name and outline of each. Give the same `group` to resources that can replace each other.
"""


@dataclass(frozen=True, slots=True)
class Dwell:
    """One robot stood at one place for a while."""

    vendor: str
    datum: str
    x_m: float
    """Centre of the envelope in the floor's frame."""
    y_m: float
    size_m: float
    """The longer side of its envelope."""
    dwell_s: float
    """How long it stood."""
    states: tuple[str, ...]
    """Operational states that it reported there."""


@dataclass(slots=True)
class _Stand:
    """A robot that stands."""

    spot: tuple[str, float, float]
    came_s: float
    last_s: float
    vendor: str
    size_m: float
    states: Counter[str]

    def dwell(self) -> Dwell:
        return Dwell(self.vendor, *self.spot, self.size_m, self.last_s - self.came_s, tuple(self.states.elements()))


def suggested(logs: Iterable[Path], site: Site) -> str:
    """Resources that the site file does not have yet, as TOML; those with most stops first."""
    logs = list(logs)
    found = list(dwells(logs, site))
    geometry = PlaceGeometry(site.resources, ())
    places = [members for members in clusters(found) if not _is_known(members, geometry)]
    names = ", ".join(path.name for path in logs)
    head = HEAD.format(logs=names, dwells=len(found), least=DWELL_S, places=len(places), fewest=FEWEST)
    lines = [head.rstrip("\n")]
    for number, members in enumerate(places, 1):
        first, *keys = section_lines("resources", _resource(number, members))
        vendors = ", ".join(sorted({dwell.vendor for dwell in members}))
        stay_s = median(dwell.dwell_s for dwell in members)
        lines += [f"\n# {len(members)} stops of {vendors}, {stay_s:.0f} s in the middle", first.lstrip("\n"), *keys]
    return "\n".join(lines) + "\n"


def dwells(logs: Iterable[Path], site: Site) -> Iterator[Dwell]:
    """Every dwell in the logs, also those that last until the logs end."""
    fleet, standing, cut_s = fleet_of(site, Measures()), dict[str, _Stand](), 0.0
    for event in LogReader().read(by_time(logs)):
        if not isinstance(event, Received) or event.refused:
            continue
        fleet.receive_recorded(event)
        if event.arrival_s - cut_s >= LOOK_S:
            cut_s = event.arrival_s
            yield from _ended(standing, fleet.next_batch(cut_s))
    yield from _ended(standing, fleet.next_batch(cut_s))
    yield from _long(stand.dwell() for stand in standing.values())


def _ended(standing: dict[str, _Stand], batch: Batch) -> Iterator[Dwell]:
    """Update where robots are; yield the dwells that this ends."""
    forecasts, start = batch.forecasts, batch.forecasts.start
    for row, (uuid, datum) in enumerate(zip(batch.robots, batch.datums(forecasts.floor[start[:-1]]), strict=True)):
        knot, event_s = int(start[row]), float(batch.event_s[row])
        spot = datum, float(forecasts.x_m[knot]), float(forecasts.y_m[knot])
        before = standing.get(uuid)
        if before and near(before.spot, spot, STANDS_M):
            before.last_s = event_s
            before.states[batch.states[row]] += 1
            continue
        if before:
            yield from _long([before.dwell()])
        size_m = float(max(forecasts.length_m[row], forecasts.width_m[row]))
        states = Counter([batch.states[row]])
        standing[uuid] = _Stand(spot, event_s, event_s, batch.vendors[row], size_m, states)


def _long(found: Iterable[Dwell]) -> Iterator[Dwell]:
    return (dwell for dwell in found if dwell.dwell_s >= DWELL_S and dwell.datum)


def clusters(found: Sequence[Dwell]) -> list[list[Dwell]]:
    """Groups of enough dwells at one place, the largest first."""
    places: list[list[Dwell]] = []
    for datum in sorted({dwell.datum for dwell in found}):
        here = [dwell for dwell in found if dwell.datum == datum]
        pairs = cKDTree([(dwell.x_m, dwell.y_m) for dwell in here]).query_pairs(SAME_M, output_type="ndarray")
        joined = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(here), len(here)))
        _, labels = connected_components(joined, directed=False)
        groups: dict[int, list[Dwell]] = {}
        for label, dwell in zip(labels.tolist(), here, strict=True):
            groups.setdefault(label, []).append(dwell)
        places += [group for group in groups.values() if len(group) >= FEWEST]
    return sorted(places, key=lambda group: (-len(group), group[0].datum, group[0].x_m, group[0].y_m))


def _resource(number: int, members: Sequence[Dwell]) -> Resource:
    """A rectangle around the dwells, half an envelope wider on every side, to the decimetre."""
    x, y = [dwell.x_m for dwell in members], [dwell.y_m for dwell in members]
    margin_m = max(dwell.size_m for dwell in members) / 2
    west, south = floor(10 * (min(x) - margin_m)) / 10, floor(10 * (min(y) - margin_m)) / 10
    east, north = ceil(10 * (max(x) + margin_m)) / 10, ceil(10 * (max(y) + margin_m)) / 10
    state, _ = Counter(state for dwell in members for state in dwell.states).most_common(1)[0]
    return Resource(
        id=f"place-{number}",
        kind="charger" if state == "charging" else "parking" if state == "idle" else "dock",
        datum=members[0].datum,
        polygon=((west, south), (east, south), (east, north), (west, north)),
    )


def _is_known(members: Sequence[Dwell], geometry: PlaceGeometry) -> bool:
    """Whether most of these dwells are in a resource of the site."""
    x_m, y_m = np.array([dwell.x_m for dwell in members]), np.array([dwell.y_m for dwell in members])
    inside = geometry.resources_at([dwell.datum for dwell in members], x_m, y_m)
    return sum(resource is not None for resource in inside) > len(members) / 2
