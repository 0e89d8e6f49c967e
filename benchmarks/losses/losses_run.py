"""One simulated floor: its true losses, and those that the service finds in its robots' messages."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from benchmarks.losses.true_losses import LostByLabel, LostBySecond, TrueLosses
from benchmarks.watch_demo.floor import STEP_S, Floor, Post
from benchmarks.watch_demo.watching import START_S
from deconflict.foresight.losses.loss_places import LossPlaces, PlacedLoss
from deconflict.foresight.probability.estimator import ProbabilityEstimator
from deconflict.settings.fleet_factory import fast_fleet_of
from deconflict.settings.site import Conflict
from deconflict.settings.site_file import load
from deconflict.simulation.demo.demo_site import demo_site
from deconflict.simulation.participants import VendorName
from ingest.batch import Batch
from ingest.frames.floor_numbers import FloorNumbers
from ingest.measures.measures import Measures

SPREAD = 0.618
"""Robots without paths are spread evenly over the vendors."""


@dataclass(frozen=True, slots=True, eq=False)
class LossesRun:
    """What happened, and what was found."""

    true: LostBySecond
    by_place: LostByLabel
    """Of robots."""
    by_kind: LostByLabel
    found: list[PlacedLoss]
    rows: dict[str, int]
    """By UUID, the row of each robot and person of the halls."""
    robots: list[int]
    """Rows of robots."""
    vendors: dict[int, int]
    """By row, the number of the vendor."""


def batches_of(floor: Floor, truth: TrueLosses, seconds: float, without_paths: float) -> Iterator[Batch]:
    """The batches of a floor, step by step. Of the robots, the share `without_paths` reports no path."""
    post, fleet, is_first = Post(), fast_fleet_of(load(demo_site()), Measures()), True
    silenced = {member.uuid for row, member in enumerate(floor.members) if row * SPREAD % 1 < without_paths}
    while floor.world.t_s < seconds:
        post.carry(floor, fleet, lambda raw: _without_path(raw, silenced))
        truth.update(STEP_S)
        yield fleet.next_batch(floor.now_s, is_first)
        is_first = False


def run(robots: int, seed: int, seconds: float, without_paths: float) -> LossesRun:
    floor = Floor(robots, seed, START_S, Conflict().clearance_m)
    site = load(demo_site())
    places, bounds = LossPlaces.of(site), Conflict()
    truth = TrueLosses(floor.world, places)
    foresight = ProbabilityEstimator(bounds.clearance_m, bounds.apart_m, bounds.horizon_s, Measures())
    numbers, found = FloorNumbers(Measures()), list[PlacedLoss]()
    for batch in batches_of(floor, truth, seconds, without_paths):
        foresight.receive(numbers.renumbered(batch))
        found += places.placed(foresight.losses.take(), numbers.names)
    halls = len(floor.world)
    members = floor.members[:halls]
    return LossesRun(
        true=truth.by_pair,
        by_place=truth.by_place,
        by_kind=truth.by_kind,
        found=found,
        rows={member.uuid: row for row, member in enumerate(members)},
        robots=[row for row, member in enumerate(members) if not member.make.person],
        vendors={row: list(VendorName).index(member.make.vendor) for row, member in enumerate(members)},
    )


def _without_path(raw: bytes, silenced: Iterable[str]) -> bytes:
    if not silenced or b'"path"' not in raw:
        return raw
    message = json.loads(raw)
    if message["uuid"].lower() in silenced:
        message.pop("path", None)
    return json.dumps(message).encode()
