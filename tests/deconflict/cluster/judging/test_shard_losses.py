"""The losses of one engine's share."""

from math import inf

from deconflict.cluster.judging.loss_writer import ShardLosses
from deconflict.cluster.tiles.tiles import Area, Grid
from deconflict.engine.engine_metrics import LOST_SECONDS
from deconflict.foresight.losses.loss import Loss, LossKind, LossNotice
from deconflict.foresight.losses.loss_places import PlacedLoss
from deconflict.settings.shared_places import Zone
from deconflict.settings.site import Site
from ingest.batch import FloorPoint
from ingest.settings import Datum
from tests.helpers.made_advisories import ROBOTS, START, made, situation
from tests.helpers.saying import HALL

TILE_M = 32.0
OUTLINE_M = ((-10.0, -10.0), (31.0, -10.0), (31.0, 10.0), (-10.0, 10.0))
AISLE = Zone(id="aisle", name="Aisle", kind="crossing", datum=HALL, polygon=OUTLINE_M)
SITE = Site(datums=(Datum(id=HALL, name="Hall"),), zones=(AISLE,))
ONSET_S = START.timestamp() + 5.0


def lost_at(x_m: float) -> PlacedLoss:
    loss = Loss(
        ROBOTS[0], ROBOTS[1], ROBOTS[1], "Acme", "", "Borealis", "Borealis", LossKind.CROSSING, ONSET_S, ONSET_S + 4.0,
        4.0, 4.0, is_sure=True, floor=0, x_m=x_m, y_m=1.0,
    )  # fmt: skip
    return PlacedLoss(loss, HALL, "")


def shard_losses() -> ShardLosses:
    return ShardLosses(SITE, lambda _: -inf)


def test_each_loss_belongs_to_the_engine_of_the_tile_in_which_it_began() -> None:
    grid = Grid(TILE_M)
    areas = [Area(grid, [grid.root(FloorPoint(HALL, x_m, 1.0))]) for x_m in (1.0, TILE_M + 1.0)]
    losses = [lost_at(TILE_M + off_m) for off_m in (-20.0, -0.01, 0.0, 0.01, 20.0)]
    owned = [[placed.loss.x_m for placed in shard_losses().own(losses, area)] for area in areas]
    assert owned == [[12.0, 31.99], [32.0, 32.01, 52.0]]


def test_a_loss_has_its_place_and_what_any_engine_published() -> None:
    shard, grid = shard_losses(), Grid(TILE_M)
    shard.note(ONSET_S, [made(0), situation(0)])
    (placed,) = shard.own([lost_at(12.0)], Area(grid, [grid.root(FloorPoint(HALL, 1.0, 1.0))]))
    assert (placed.place, placed.notice) == ("Aisle", LossNotice(is_warned=True))
    labels = ["Acme", "Borealis", "crossing", "Aisle"]
    assert shard.measures.as_document()["values"][LOST_SECONDS] == [[labels, 4.0]]
