"""Robots that meet in a lane that bends."""

from math import cos, pi, sin

from deconflict.settings.importers.drawing import drawn_site
from deconflict.settings.importers.plan import ImportedPlan, Lane, Level, Node, Spot
from tests.deconflict.contention.scenes import Scene, Script, raised, site
from tests.helpers.saying import HALL

RADIUS_M = 6.0
DEGREES = range(180, -1, -5)


def on_the_arc(degrees: float) -> Spot:
    return RADIUS_M * cos(degrees * pi / 180), RADIUS_M * sin(degrees * pi / 180)


def drive(start: int, end: int, mps: float) -> list[tuple[float, float, float]]:
    """Times and places along the arc."""
    step = 2 if end > start else -2
    degrees_per_s = mps / RADIUS_M * 180 / pi
    return [(abs(at - start) / degrees_per_s, *on_the_arc(at)) for at in range(start, end + step, step)]


def test_robots_that_meet_aside_of_its_middle_block_each_other_before_they_stand() -> None:
    west, *bends, east = map(on_the_arc, DEGREES)
    lane = Lane("west", "east", two_way=True, bends=tuple(bends))
    level = Level("0", (Node("west", west), Node("east", east)), (lane,), datum=HALL)
    zones = drawn_site(ImportedPlan("arc", "a plan", (level,)), 1.2).zones
    robots = {
        "fast": Script(drive(180, 16, 1.0), means=drive(180, 0, 1.0)),
        "slow": Script(drive(0, 10, 0.1), means=drive(0, 180, 0.1), vendor="Birch"),
    }
    assert raised(Scene(site(*zones), robots).run(12.0), "deadlock")
