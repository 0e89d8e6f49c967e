"""Trains in the recorded motion: what comes near a trailer alone came near the train."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from itertools import pairwise
from math import inf

import numpy as np
import pytest

from ingest.batch import Forecasts
from ingest.shapes import Shape, Trailer, shapes_of
from metrics.report.drawings import figures
from metrics.truth.encounters import EncounterFinder

TRAILERS = (Trailer(1.0, 0.8, 1.5),) * 4


def crossed(trailers: tuple[Trailer, ...], others: int = 1) -> EncounterFinder:
    """A train goes east at 1 m/s. Others, which are round, go north and cross its way 5 m behind its middle, one after
    the other."""
    truth = EncounterFinder([0.3], 0.1)
    for second in range(20):
        t_s, n = float(second), 1 + others
        x_m = np.array([t_s, *[5.0] * others])
        y_m = np.array([0.0, *(t_s - 10.0 - 30.0 * row for row in range(others))])
        start, floor, sizes_m = np.arange(n + 1), np.zeros(n, np.int64), (np.ones(n), np.ones(n))
        levels_m = np.full(n, -inf), np.full(n, inf)
        forecasts = Forecasts(start, np.full(n, t_s), x_m, y_m, np.zeros(n), floor, *sizes_m, *levels_m)
        shapes = shapes_of([Shape((), (0.0, 0.0), trailers), *[Shape.circle(1.0)] * others])
        truth.report(["train", "b", "c"][:n], replace(forecasts, shapes=shapes))
        truth.advance(t_s)
    truth.finish()
    return truth


@pytest.mark.parametrize("trailers", [(), TRAILERS])
def test_a_robot_that_only_a_trailer_meets_has_an_encounter_with_the_train(trailers: tuple[Trailer, ...]) -> None:
    truth = crossed(trailers, others=2)
    assert truth.motion.present_s() == {"train": 19.0, "b": 19.0, "c": 19.0}
    assert [each.pair for each in truth.encounters(0.3)] == ([("b", "train")] if trailers else [])


def test_an_encounter_with_a_train_begins_when_the_first_trailer_is_near_and_ends_with_the_last() -> None:
    """The other is within 0.3 m of a trailer until it is past the trailers' sides."""
    (met,) = crossed(TRAILERS).encounters(0.3)
    assert met.start_s == pytest.approx(10.0 - 0.5 - 0.4 - 0.3, abs=0.11)
    assert met.end_s == pytest.approx(10.0 + 0.5 + 0.4 + 0.3, abs=0.11)
    assert met.foreseeable


def test_the_nearest_scene_is_drawn_with_trailers_and_true_shapes() -> None:
    truth = crossed(TRAILERS)
    (scene,) = truth.scenes.finish(truth.motion)
    document = scene.document()
    assert (document["x_m"], document["y_m"]) == pytest.approx((5.0, 0.0), abs=0.8)
    bodies = dict(zip(document["robots"], document["bodies"], strict=True))
    assert [len(body["outlines_m"]) for body in bodies["train"]] == [1] * 5
    assert [len(body["outlines_m"][0]) for body in bodies["b"]] == [24]
    assert [body["track"].split(";")[0].split()[1:] for body in bodies["train"]] == [["0.00", "0.000"]] * 5
    middles_m = [float(body["track"].split()[0]) for body in bodies["train"]]
    assert [round(ahead - behind, 2) for ahead, behind in pairwise(middles_m)] == [1.5] * 4
    polygons = list(ET.fromstring(figures.scene(document)).iter("polygon"))  # noqa: S314 - our own text
    assert sum(mark.attrib["class"].startswith("envelope") for mark in polygons) == 6
