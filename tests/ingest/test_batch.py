import json
from dataclasses import fields, replace

import numpy as np
import pytest

from deconflict_client.participant_kinds import ParticipantKind
from ingest.batch import AMOUNTS, Amounts, Basis, Batch, Claim, Destinations, Forecasts
from ingest.shapes import Shape, ShapePart, shapes_of


def forecasts(*knots: int, seed: int = 1) -> Forecasts:
    random = np.random.default_rng(seed)
    n, k = len(knots), sum(knots)
    return Forecasts(
        start=np.concatenate([[0], np.cumsum(knots)]).astype(np.int64),
        t_s=np.sort(random.uniform(0, 10, k)),
        x_m=random.normal(size=k),
        y_m=random.normal(size=k),
        yaw_rad=random.normal(size=k),
        floor=random.integers(0, 3, k),
        length_m=random.uniform(1, 2, n),
        width_m=random.uniform(1, 2, n),
        bottom_m=np.full(n, -np.inf),
        top_m=np.full(n, np.inf),
    )


def assert_same(a: Forecasts, b: Forecasts) -> None:
    for field in fields(Forecasts):
        np.testing.assert_array_equal(getattr(a, field.name), getattr(b, field.name), err_msg=field.name)


def test_taking_every_robot_and_joining_gives_the_same_forecasts() -> None:
    whole = forecasts(3, 1, 4)
    assert_same(Forecasts.joined(whole.take([row]) for row in range(3)), whole)
    nobody = Forecasts.empty()
    assert_same(Forecasts.joined([nobody, whole.take([0]), nobody, nobody, whole.take([1, 2]), nobody]), whole)


def test_take_reorders_knots_with_their_robots() -> None:
    whole = forecasts(3, 1, 4)
    swapped = whole.take([2, 0])
    np.testing.assert_array_equal(swapped.x_m, np.concatenate([whole.x_m[4:8], whole.x_m[0:3]]))
    np.testing.assert_array_equal(swapped.length_m, whole.length_m[[2, 0]])


def test_joining_nothing_is_empty() -> None:
    assert len(Forecasts.joined([])) == 0


def batch_of(*knots: int) -> Batch:
    """A robot for each number of knots."""
    n = len(knots)
    person: ParticipantKind = "person"
    return Batch(
        now_s=1792000000.123456,
        floors=("a", "ü\n"),
        robots=tuple(f"r{i}" for i in range(n)),
        vendors=("Vendor\n1",) * n,
        models=("M",) * n,
        names=("N",) * n,
        states=("navigating",) * n,
        statuses=np.arange(n),
        first_arrival_s=np.arange(n, dtype=np.float64),
        arrival_s=np.arange(n, dtype=np.float64) + 0.1,
        event_s=np.arange(n, dtype=np.float64) + 0.2,
        basis=np.full(n, int(Basis.PATH)),
        doubt_m=np.zeros(n),
        reports_within_s=np.full(n, 35.0),
        amounts=np.array([(20.0 + row, np.nan, 60.0) for row in range(n)], AMOUNTS),
        forecasts=forecasts(*knots),
        destinations=Destinations(
            start=np.arange(n + 1),
            t_s=np.arange(n, dtype=np.float64),
            x_m=np.arange(n, dtype=np.float64) + n,
            y_m=np.arange(n, dtype=np.float64) + 2 * n,
            floor=np.arange(n),
        ),
        gone=("g",),
        claims=(Claim("Alder", "Mallory", ("r1", "r2"), 3, 1792000000.0),),
        participants=(person,) * n,
        sources=tuple(f"10.0.0.{i}" for i in range(n)),
        examined=np.arange(n) % 2 == 0,
        came_s=np.arange(n, dtype=np.float64) - 100.0,
    )


@pytest.mark.parametrize("knots", [(), (1,), (2, 11)])
def test_a_batch_survives_its_bytes(knots: tuple[int, ...]) -> None:
    batch = batch_of(*knots)
    back = Batch.from_bytes(batch.to_bytes())
    assert_same(back.forecasts, batch.forecasts)
    for name in ("start", "t_s", "x_m", "y_m", "floor"):
        np.testing.assert_array_equal(getattr(back.destinations, name), getattr(batch.destinations, name))
    for name in (
        "now_s",
        "floors",
        "robots",
        "vendors",
        "names",
        "states",
        "gone",
        "claims",
        "participants",
        "sources",
    ):
        assert getattr(back, name) == getattr(batch, name)
    arrays = "statuses", "first_arrival_s", "arrival_s", "event_s", "basis", "doubt_m", "reports_within_s", "came_s"
    for name in (*arrays, "examined"):
        np.testing.assert_array_equal(getattr(back, name), getattr(batch, name))
    for name in Amounts._fields:
        np.testing.assert_array_equal(back.amounts[name], batch.amounts[name])


def test_shapes_survive_the_bytes_of_a_batch() -> None:
    made = batch_of(2, 1, 1, 3)
    part = ShapePart(((0.5, 0.1),), 0.25, 0.0, 1.5)
    shapes = [Shape.circle(1.0), None, Shape((*Shape.circle(0.3).parts, part)), Shape.circle(1.0)]
    shaped = replace(made, forecasts=replace(made.forecasts, shapes=shapes_of(shapes)))
    back = Batch.from_bytes(shaped.to_bytes()).forecasts
    assert [back.shape(row) for row in range(4)] == shapes
    assert back.shape(0) is back.shape(3)
    assert Batch.from_bytes(made.to_bytes()).forecasts.shapes is None


def test_a_batch_of_a_release_without_an_amount_is_read() -> None:
    batch = batch_of(2, 3)
    older = batch.amounts[["battery_pct", "run_time_left_s"]]
    back = Batch.from_bytes(replace(batch, amounts=older).to_bytes())
    assert back.amounts["battery_pct"].tolist() == [20.0, 21.0]
    assert np.isnan(back.amounts["load_used_pct"]).all()
    assert_same(back.forecasts, batch.forecasts)


def test_a_batch_of_a_release_without_sources_is_by_vendor_and_examined() -> None:
    batch = batch_of(2, 3)
    head, _, body = batch.to_bytes().partition(b"\n")
    document = json.loads(head)
    del document["sources"]
    assert document["layout"].pop() == ["examined", "|b1", 2]
    back = Batch.from_bytes(json.dumps(document).encode() + b"\n" + body[:-2])
    assert back.sources == batch.vendors
    assert back.examined.tolist() == [True, True]


def test_the_numbers_of_a_read_batch_stay_aligned() -> None:
    back = Batch.from_bytes(batch_of(2, 11, 1).to_bytes())
    assert all(getattr(back.forecasts, name).flags.aligned for name in ("t_s", "x_m", "floor", "length_m"))
    assert back.destinations.t_s.flags.aligned


def test_a_batch_taken_apart_and_joined_is_the_same() -> None:
    whole = batch_of(2, 11, 1)
    parts = [whole.take(np.array([row]), ("gone",) if row == 2 else ()) for row in range(3)]
    assert Batch.joined(parts).to_bytes() == replace(whole, gone=("gone",)).to_bytes()
    assert parts[1].robots == ("r1",)
    assert len(parts[1].forecasts.t_s) == 11
