"""How right suggestions are: `python -m benchmarks.whatif.suggested_floors --seeds 41 42`.

Logs of floors where it is known what a change saves, of the same floors with the change made, and of calm ones: what is
suggested, and what it is said to save. `python -m benchmarks.whatif` has the true savings.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from benchmarks.planned_floors.logs.messages import DATUM
from benchmarks.whatif.changed_halls import recorded_hall
from benchmarks.whatif.dock_yard import DOCK, dock_yard
from benchmarks.whatif.lane_yard import LANE, LaneChange, lane_yard
from benchmarks.whatif.yards import recorded_yard
from deconflict.operator.suggestions.found_suggestions import found_suggestions
from deconflict.operator.suggestions.suggested_places import SuggestedPlaces
from deconflict.settings.shared_places import Resource, Zone
from deconflict.settings.site import Site
from deconflict.settings.site_file import load
from deconflict.simulation.demo.demo_site import demo_site
from ingest.settings import Datum
from metrics.whatif.change import NamedOutline
from metrics.whatif.recorded_tracks import RecordedFloor
from metrics.whatif.suggested_changes import loss_evidence

HALL = (Datum(id=DATUM, name="Yard"),)
Recorded = Callable[[int, float], RecordedFloor]


def _corners(place: NamedOutline) -> tuple[tuple[float, float], ...]:
    return tuple((x_m, y_m) for x_m, y_m in place.outline.exterior.coords[:-1])


DOCK_SITE = Site(
    datums=HALL, resources=(Resource(id="dock", name="Dock", kind="dock", datum=DATUM, polygon=_corners(DOCK)),)
)
LANE_SITE = Site(
    datums=HALL,
    zones=(Zone(id="lane", name="Lane", kind="aisle", datum=DATUM, polygon=_corners(LANE), axis=LANE.axis),),
)


@dataclass(frozen=True, slots=True)
class SuggestedFloor:
    """A floor, and how its log is made from a seed and a length in seconds."""

    name: str
    site: Site
    recorded: Recorded


def _docks(robots: int, docks: int) -> Recorded:
    return lambda seed, seconds: recorded_yard(dock_yard(robots, docks), seed, seconds)


def _lane(robots: int, change: LaneChange) -> Recorded:
    return lambda seed, seconds: recorded_yard(lane_yard(robots, change), seed, seconds)


def _halls(robots: int) -> Recorded:
    return lambda seed, seconds: recorded_hall(robots, seed, seconds)


def floors() -> list[SuggestedFloor]:
    halls = load(demo_site())
    return [
        SuggestedFloor("yard, 5 robots, one dock", DOCK_SITE, _docks(5, 1)),
        SuggestedFloor("yard, 6 robots, one dock", DOCK_SITE, _docks(6, 1)),
        SuggestedFloor("yard, 5 robots, two docks", DOCK_SITE, _docks(5, 2)),
        SuggestedFloor("yard, 2 robots, one dock", DOCK_SITE, _docks(2, 1)),
        SuggestedFloor("lane, 3 robots", LANE_SITE, _lane(3, LaneChange())),
        SuggestedFloor("lane, 3 robots, one-way", LANE_SITE, _lane(3, LaneChange(one_way=True))),
        SuggestedFloor(
            "lane, 3 robots, wider and two lanes", LANE_SITE, _lane(3, LaneChange(wider_m=2.0, two_lanes=True))
        ),
        SuggestedFloor("lane, 1 robot", LANE_SITE, _lane(1, LaneChange())),
        SuggestedFloor("halls, 60 robots", halls, _halls(60)),
        SuggestedFloor("halls, 10 robots", halls, _halls(10)),
    ]


def main(arguments: Sequence[str] | None = None) -> None:
    options = argparse.ArgumentParser(prog="python -m benchmarks.whatif.suggested_floors", description=__doc__)
    options.add_argument("--floors", nargs="+", default=[""], metavar="NAME", help="beginnings of their names")
    options.add_argument("--seeds", type=int, nargs="+", default=[41, 42])
    options.add_argument("--minutes", type=float, default=20.0)
    args = options.parse_args(arguments)
    for floor in floors():
        if floor.name.startswith(tuple(args.floors)):
            for seed in args.seeds:
                _print(floor, seed, 60 * args.minutes)


def _print(floor: SuggestedFloor, seed: int, seconds: float) -> None:
    evidence = loss_evidence(floor.recorded(seed, seconds), floor.site)
    print(f"{floor.name}, seed {seed}: {evidence.lost_s / evidence.hours:.0f} s an hour lost", flush=True)
    for found in found_suggestions(evidence, SuggestedPlaces.of(floor.site)):
        saving = found.saving
        span = f"{saving.low_s_per_hour:.0f} to {saving.high_s_per_hour:.0f} s an hour" if saving else ""
        lost = f"{found.evidence.lost_s_per_hour:.0f} s lost in {found.evidence.losses} losses"
        print(f"  {found.kind} {found.place} {found.vendor}: {lost}, saves {span}", flush=True)


if __name__ == "__main__":
    main()
