"""Who is told of a robot."""

from dataclasses import replace

import numpy as np
import pytest

from deconflict.cluster.tiles.tile_channels import (
    EVERY,
    GONE,
    MOST_BYTES,
    ChannelSorter,
    channel,
    parcels_of,
    reaches_m,
    wide_channel,
)
from deconflict.cluster.tiles.tiles import Grid, Tile
from ingest.batch import Batch
from ingest.frames.floor_numbers import FloorNumbers
from ingest.measures.measures import Measures
from ingest.shapes import Shape, Trailer, shapes_of
from tests.deconflict.cluster.made_shards import REACH_M, SITE, Course, Ingests
from tests.helpers.saying import HALL, LOFT, robot


def sorter() -> ChannelSorter:
    return ChannelSorter(Grid(20.0), SITE.conflict, REACH_M)


def batch_at(tick: int, **courses: Course) -> Batch:
    first, second = Ingests(courses).batches(tick)
    return first if len(first) else second


def test_a_robot_goes_to_its_tile_and_once_more_to_its_last_tile() -> None:
    channel_sorter = sorter()
    west, east = batch_at(0, A=lambda _: (19.0, 5.0, 0.0)), batch_at(0, A=lambda _: (21.0, 5.0, 0.0))
    there, here = (channel(Tile(HALL, column, 0)) for column in (0, 1))
    assert set(channel_sorter.sort(west)) == {there, EVERY}
    assert set(channel_sorter.sort(east)) == {there, here, EVERY}
    assert set(channel_sorter.sort(east)) == {here, EVERY}


def test_a_robot_that_may_pass_the_reach_goes_to_its_floor() -> None:
    batches = sorter().sort(batch_at(0, A=lambda t: (7.0 * t, 5.0, 0.0)))
    assert set(batches) == {channel(Tile(HALL, 0, 0)), wide_channel(HALL), EVERY}
    assert wide_channel(LOFT) not in batches


def test_a_smaller_reach_applies_at_once() -> None:
    channel_sorter, batch = sorter(), batch_at(0, A=lambda t: (1.5 * t, 5.0, 0.0))
    assert wide_channel(HALL) not in channel_sorter.sort(batch)
    channel_sorter.renew(SITE.conflict, 10.0)
    assert wide_channel(HALL) in channel_sorter.sort(batch)


def test_a_forgotten_robot_goes_to_everybody_once() -> None:
    channel_sorter, batch = sorter(), batch_at(0, A=lambda _: (19.0, 5.0, 0.0))
    channel_sorter.sort(batch)
    batches = channel_sorter.sort(batch.take(np.zeros(0, np.int64), (robot("A"),)))
    assert {name: part.gone for name, part in batches.items()} == dict.fromkeys((GONE, EVERY), (robot("A"),))
    assert channel_sorter.roots() == set()


def test_a_tile_in_which_two_may_meet_needs_an_owner_though_it_is_empty() -> None:
    """Two that come to a corner of the grid along its lines meet on the other side of them."""
    channel_sorter = sorter()
    channel_sorter.sort(batch_at(0, A=lambda t: (t - 8.0, 0.0, 0.0)))
    assert Tile(HALL, -1, -1) in channel_sorter.roots()


def test_a_large_batch_is_split_into_parcels_that_a_server_accepts() -> None:
    some = batch_at(0, **{f"R-{number}": (lambda _: (0.0, 0.0, 0.0)) for number in range(40)})
    large = Batch.joined([some] * (4 * MOST_BYTES // len(some.to_bytes())))
    messages = parcels_of(large.take(np.arange(len(large)), ("gone",)))
    assert len(messages) >= 3
    assert max(map(len, messages)) <= MOST_BYTES
    parts = [Batch.from_bytes(message) for message in messages]
    assert Batch.joined(parts).robots == large.robots
    assert [part.gone for part in parts] == [("gone",)] + [()] * (len(parts) - 1)


def test_an_empty_batch_goes_to_no_channel() -> None:
    assert sorter().sort(batch_at(0, A=lambda _: (0.0, 0.0, 0.0)).take(np.zeros(0, np.int64))) == {}


@pytest.mark.parametrize("name", ["a.b", "a b", "*", ">", "ä/1"])
def test_any_floor_name_becomes_one_token_of_a_subject(name: str) -> None:
    datum, column, row = channel(Tile(name, -3, 4)).split(".")
    assert (column, row) == ("-3", "4")
    assert not set(datum) & set("*> ")


def test_floors_that_two_ingests_number_differently_are_the_same() -> None:
    floors, hall = FloorNumbers(Measures()), batch_at(0, A=lambda _: (19.0, 5.0, 0.0))
    (loft, _) = Ingests({"A": lambda _: (1.0, 1.0, 0.0)}, {"A": LOFT}).batches(0)
    batches = [floors.renumbered(batch) for batch in (hall, loft, hall)]
    assert [batch.floors[batch.forecasts.floor[0]] for batch in batches] == [HALL, LOFT, HALL]
    assert hall.forecasts.floor[0] == loft.forecasts.floor[0]


def test_a_robot_whose_floor_is_not_listed_goes_to_its_last_tile_and_is_refused_by_the_engines() -> None:
    channel_sorter, batch, measures = sorter(), batch_at(0, A=lambda _: (19.0, 5.0, 0.0)), Measures()
    channel_sorter.sort(batch)
    wrong = replace(batch, forecasts=replace(batch.forecasts, floor=batch.forecasts.floor + 7))
    batches = channel_sorter.sort(wrong)
    assert set(batches) == {channel(Tile(HALL, 0, 0)), EVERY}
    assert len(FloorNumbers(measures).joined([batch, batches[EVERY]])) == 1
    assert measures.values["deconflict_invalid_forecasts_total"] == {("floor-not-listed",): 1}


def test_a_train_reaches_as_far_as_its_last_trailer() -> None:
    forecasts = batch_at(0, A=lambda _: (5.0, 5.0, 0.0)).forecasts
    trailers = (Trailer(1.0, 0.0, 2.0),) * 3
    assert reaches_m(forecasts)[0] < 1.0
    assert reaches_m(replace(forecasts, shapes=shapes_of([Shape((), (0.0, 0.0), trailers)]))).tolist() == [6.5]
