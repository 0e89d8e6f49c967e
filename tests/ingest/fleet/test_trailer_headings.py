from math import cos, nan, sin

import pytest

from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from ingest.fleet.placement import trailer_headings
from ingest.fleet.prediction.forecast_model import Sighting
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Model, Trailers, Vendor
from ingest.shapes import Shape, Trailer
from tests.helpers.saying import identity, status

NOW_S = 1_792_000_000.0
LINE = Connection(1)
TRAIN = Shape((), (0.0, 0.0), (Trailer(1.0, 0.8, 1.5),) * 2)


def seen(x_m: float, y_m: float, yaw_rad: float, floor: int = 0) -> Sighting:
    return Sighting(NOW_S, floor, x_m, y_m, yaw_rad)


def test_trailers_are_straight_behind_a_robot_that_is_first_seen_or_far_from_where_it_was() -> None:
    here = seen(0.0, 0.0, 0.5)
    assert trailer_headings(TRAIN, (), None, here) == (0.5, 0.5)
    assert trailer_headings(TRAIN, (0.0, 0.0), seen(20.0, 0.0, 0.0), here) == (0.5, 0.5)
    assert trailer_headings(TRAIN, (0.0, 0.0), seen(0.0, 0.0, 0.0, 1), here) == (0.5, 0.5)
    assert trailer_headings(None, (0.1, 0.1), None, here) == ()


def test_a_train_around_a_corner_is_bent_by_where_it_was() -> None:
    model = Model(trailers=Trailers(count=3, length_m=1.2, width_m=0.8, hitch_m=1.5))
    fleet = fleet_of(Site(vendors=(Vendor(name="Alder", models={"A1": model}),)), Measures())
    fleet.receive(identity("A-1", NOW_S), NOW_S, LINE)
    for second in range(12):
        turn = max(second - 8, 0) * 0.4
        x = min(second, 8) + sum(cos(0.4 * k) for k in range(1, max(second - 8, 0) + 1))
        y = sum(sin(0.4 * k) for k in range(1, max(second - 8, 0) + 1))
        fleet.receive(status("A-1", NOW_S + second, x, y, turn), NOW_S + second, LINE)
    shape = fleet.next_batch(NOW_S + 12).forecasts.shape(0)
    assert shape is not None
    first, second_yaw, third = (trailer.yaw_rad for trailer in shape.trailers)
    assert 1.2 > first > second_yaw > third > 0.0
    fleet.receive(identity("A-1", NOW_S, robotModel="A2"), NOW_S + 13, LINE)
    assert fleet.next_batch(NOW_S + 13).forecasts.shapes is None


@pytest.mark.parametrize("yaw_rad", [nan])
def test_a_train_without_a_heading_is_the_circle_that_holds_it(yaw_rad: float) -> None:
    assert TRAIN.reach_m(0.7) == pytest.approx(3.0 + 0.6403, abs=1e-3)
    assert len(trailer_headings(TRAIN, (), None, seen(0.0, 0.0, yaw_rad))) == 2
