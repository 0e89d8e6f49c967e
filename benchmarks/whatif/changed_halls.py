"""The demo's halls with a change that is really made: what robots lose and drive there, run after run."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isclose

import numpy as np

from benchmarks.watch_demo.floor import STEP_S, Floor, Post
from benchmarks.watch_demo.watching import START_S
from deconflict.settings.fleet_factory import fast_fleet_of
from deconflict.settings.site import Conflict, Site
from deconflict.settings.site_file import load
from deconflict.simulation.demo.demo_site import demo_site
from deconflict.simulation.driving.motion import Activity
from deconflict.simulation.driving.traffic import NO_LIMITS, World
from deconflict.simulation.floor_layout import GROUND, Layout, layout_for
from deconflict.simulation.participants import VendorName, participants
from deconflict.simulation.scripted_annex import split
from ingest.batch import Floats
from ingest.measures.measures import Measures
from metrics.whatif.change import named_outlines, slow_zone
from metrics.whatif.recorded_tracks import RecordedFloor, TrackReader
from metrics.whatif.simulated.model_runs import FloorFigures, OpenLosses


@dataclass(frozen=True, slots=True)
class HallChange:
    """A change of the halls: a one-way aisle that runs along y, a speed limit, or a vendor that goes first."""

    name: str
    one_way_x_m: float | None = None
    """x of the aisle."""
    sign: float = 1.0
    """1 if robots drive towards larger y, -1 if towards smaller y."""
    place: str = ""
    share: float = 1.0
    first: str = ""
    """Vendor."""

    def towards(self, sign: float) -> "HallChange":
        return replace(self, sign=sign)


def with_one_way(layout: Layout, aisle_x_m: float, sign: float) -> Layout:
    """The layout with an aisle that runs along y one-way: towards larger y if `sign` is 1. Bays on both sides open on
    the lane that stays."""
    nodes = [node for node, place in enumerate(layout.places) if _in_aisle(layout, node, aisle_x_m, place[0])]
    stations: dict[float, list[int]] = {}
    for node in nodes:
        stations.setdefault(layout.places[node][1], []).append(node)
        for after in [after for after in layout.onward[node] if after in nodes]:
            del layout.onward[node][after]
    layout.join(*(stations[y_m][0] for y_m in sorted(stations, reverse=sign < 0)))
    for gate, *others in stations.values():
        for bay in [bay for other in others for bay in layout.onward[other]]:
            layout.onward[bay].clear()
            layout.join(gate, bay, gate)
    return layout


def _in_aisle(layout: Layout, node: int, aisle_x_m: float, x_m: float) -> bool:
    return layout.floors[node] == GROUND and isclose(x_m, aisle_x_m) and node not in layout.bay_nodes


def true_figures(
    robots: int, seed: int, seconds: float, change: HallChange, site: Site, floors: Sequence[str]
) -> FloorFigures:
    """What happens in the halls with a change, per hour."""
    members, _ = split(participants(robots))
    layout, speed_shares = layout_for(robots), NO_LIMITS
    if change.one_way_x_m is not None:
        layout = with_one_way(layout, change.one_way_x_m, change.sign)
    if change.place:
        speed_shares = slow_zone(named_outlines(site, floors, change.place), change.share).speed_shares
    world = World(layout, members, np.random.default_rng(seed), speed_shares)
    world.spread_start()
    if change.first:
        world.goes_first = world.fleet == list(VendorName).index(VendorName(change.first))
    losses, arrivals = OpenLosses(world), 0
    drove = np.zeros(len(world), np.bool_)
    while world.t_s < seconds:
        world.step(STEP_S)
        losses.update(STEP_S)
        stands = world.doing == Activity.STANDING
        arrivals += int((drove & stands & ~world.person).sum())
        drove = ~stands
    lost_s, delays = losses.finish()
    return FloorFigures(float(lost_s.sum()), arrivals, float(delays.sum())).per_hour(seconds)


def recorded_hall(robots: int, seed: int, seconds: float) -> RecordedFloor:
    """The log of the halls as they are, as the service hears it."""
    floor, post, site = Floor(robots, seed, START_S, Conflict().clearance_m), Post(), load(demo_site())
    fleet, reader, is_first = fast_fleet_of(site, Measures()), TrackReader(site), True
    while floor.world.t_s < seconds:
        post.carry(floor, fleet)
        reader.add(fleet.next_batch(floor.now_s, is_first))
        is_first = False
    return reader.floor()


def mean_change(before: Sequence[FloorFigures], after: Sequence[FloorFigures], figure: str) -> float:
    return float(np.mean(_values(after, figure)) - np.mean(_values(before, figure)))


def standard_error(before: Sequence[FloorFigures], after: Sequence[FloorFigures], figure: str) -> float:
    """Of the mean change. The runs with and without the change soon have nothing in common but their number."""
    variances = [np.var(_values(runs, figure), ddof=1) / len(runs) for runs in (before, after)]
    return float(np.sqrt(sum(variances)))


def _values(runs: Sequence[FloorFigures], figure: str) -> Floats:
    return np.array([getattr(run, figure) for run in runs])
