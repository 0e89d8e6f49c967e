"""A fleet goes on with what another one had seen of how fast robots drive."""

import msgspec

from ingest.fleet.prediction.forecast_model import Sighting
from ingest.fleet.prediction.kept_paces import PACES, kept_paces, take_over
from ingest.fleet.prediction.pace import CORNER, Pace, PaceBook


def at(second: int) -> Sighting:
    """It drives ever faster along x."""
    return Sighting(float(second), 0, 0.01 * second**2, 0.0, 0.0)


def driven(pace: Pace, begin: int, end: int) -> Pace:
    for second in range(begin, end):
        pace.observe(at(second))
        pace.kind = 1.5
        pace.expect_beyond_corner(0.01 * (second + 1.5) ** 2, 0.2, second + 1.0)
    return pace


def test_what_was_seen_of_robots_goes_on_in_another_fleet() -> None:
    book, pace = PaceBook(), Pace()
    pace.of_model = book.of_model("Basalt", "B7")
    driven(pace, 0, 50)
    text = msgspec.json.encode(kept_paces(book, [("b-1", pace)]))
    other = PaceBook()
    take_over(PACES.decode(text), other)
    new = Pace()
    new.of_model = other.of_model("Basalt", "B7")
    resumed = other.take_up("b-1", new)
    assert resumed.of_model is new.of_model
    for each in (driven(pace, 50, 60), driven(resumed, 50, 60)):
        assert each.own.keys() == {1.5, CORNER}
    for kind in (1.5, CORNER):
        assert (resumed.seen(kind), resumed.usual(kind)) == (pace.seen(kind), pace.usual(kind))
        assert list(resumed.own[kind].samples) == list(pace.own[kind].samples)
    assert other.take_up("b-1", new) is new
