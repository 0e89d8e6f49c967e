from dataclasses import dataclass
from itertools import pairwise
from math import nan, pi
from random import Random
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from ingest.fast_path import loader
from ingest.fast_path.path_kernels import follow, placed
from ingest.fleet.forecast import Body, Forecast, Sighting, View, forecast
from ingest.frames.frame_registry import Frame
from ingest.frames.transforms import Adjusted, Transform
from ingest.languages.massrobotics.parser import Status, read
from ingest.languages.massrobotics.path_points import Path
from ingest.settings import Reading
from tests.helpers.saying import HALL, LOFT, status
from tests.ingest.frames import made_maps

NOW_S = 1_790_000_000.0
MAPS: tuple[Transform | None, ...] = (
    None,
    made_maps.similarity(0.7, 0.98, (12.0, -3.0), mirrored=True),
    made_maps.sheared(-2.0, 1.1, 0.9, 0.1),
    Adjusted(made_maps.similarity(0.3, 1.0, (1.0, 2.0)), made_maps.HALL, made_maps.jolts(6, 0.5, 1)),
)


@dataclass
class Case:
    """A robot in some frame, with a path that starts about where it is."""

    here: Sighting
    view: View
    status: Status


def case(random: Random) -> Case:
    transform, floor = random.choice(MAPS), random.choice((0, 0, 0, 1))
    frame, offset_s = Frame("hall", known=True, transform=transform), random.choice((0.0, 0.0, -7.25, 3600.5))
    points, x, y, t_s = [], random.uniform(-5, 45), random.uniform(-5, 30), NOW_S - offset_s + random.uniform(-3, 1)
    start = frame.placed([(x, y, random.uniform(-pi, pi))])[0]
    here = Sighting(NOW_S, 0, *start, random.choice((1.0, 0.0, None)))
    if random.random() < 0.05:
        here = replace(here, yaw_rad=nan)
    for _ in range(random.randint(1, 12)):
        t_s += random.choice((1.0, 1.0, 1.0, 0.3, 5.0, 0.0 if random.random() < 0.1 else 1.0))
        x, y = x + random.uniform(-1.5, 1.5), y + random.uniform(-1.5, 1.5) * random.choice((1, 1, 1, 1, 1, 1, 12))
        points.append((t_s, x, y, random.uniform(-pi, pi)))
    body = Body((1.0, 0.5, 0.4), random.choice(((0.0, 0.0), (0.2, -0.1))), random.choice((None, 2.0)))
    message = read(status("robot", NOW_S, 1.0, 2.0))
    assert isinstance(message, Status)
    in_order = all(later[0] > earlier[0] for earlier, later in pairwise(points))
    path = Path(tuple(points), (HALL,) * len(points), in_order, (points[0][0], points[-1][0]))
    here = replace(here, clock_offset_s=offset_s)
    return Case(here, View(body, lambda _: (frame, floor), Reading()), replace(message, path=path))


def as_array(said: Status) -> Status:
    return replace(said, path=replace(said.path, poses=np.array(said.path.poses)))


def shown(one: Forecast) -> str:
    return repr(replace(one, knots=tuple(tuple(map(float, knot)) for knot in one.knots)))


@pytest.fixture(autouse=True)
def _loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loader, "follow", follow)
    monkeypatch.setattr(loader, "placed", None)


def test_a_pose_is_placed_as_it_is_without() -> None:
    random = Random(6)
    for transform in filter(None, MAPS):
        for _ in range(2000):
            pose = random.uniform(-20, 60), random.uniform(-20, 60), random.choice((nan, random.uniform(-pi, pi)))
            assert repr(placed(*pose, transform.table)) == repr(transform.pose(*pose))


def test_a_path_is_followed_as_it_is_knot_by_knot() -> None:
    random, followed = Random(5), 0
    for _ in range(4000):
        one = case(random)
        quickly = forecast(as_array(one.status), one.here, one.view)
        assert shown(quickly) == shown(forecast(one.status, one.here, one.view))
        followed += isinstance(quickly.knots, np.ndarray)
    assert 1500 < followed < 3500


@pytest.mark.parametrize(
    ("said", "here"),
    [
        ({"operationalState": "idle"}, {}),
        ({"errorCodes": ["robot stuck"]}, {}),
        ({}, {"yaw_rad": nan}),
        ({}, {"t_s": NOW_S + 60}),
        ({}, {"x_m": 500.0}),
    ],
    ids=["idle", "blocked", "no heading", "past", "elsewhere"],
)
def test_what_is_not_plain_is_left_to_python(said: dict[str, Any], here: dict[str, float]) -> None:
    message = read(status("robot", NOW_S, 1.0, 2.0, **said))
    assert isinstance(message, Status)
    points = (NOW_S + 1, 2.0, 2.0, 0.0), (NOW_S + 2, 3.0, 2.0, 0.0)
    path = Path(points, (LOFT,) * 2, in_order=True, ends_s=(NOW_S + 1, NOW_S + 2))
    message = replace(message, path=path)
    sight = replace(Sighting(NOW_S, 0, 1.0, 2.0, 0.0, 1.0), **here)
    view = View(Body((1.0, 0.5, 0.4)), lambda _: (Frame("loft", known=True), 0), Reading())
    one = forecast(as_array(message), sight, view)
    assert isinstance(one.knots, tuple)
    assert shown(one) == shown(forecast(message, sight, view))
