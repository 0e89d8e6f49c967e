from typing import Any

import numpy as np
import pytest
import shapely

from deconflict.sweep.sweep_once import sweep
from ingest.batch import Forecasts
from tests.helpers.made_encounters import NOW_S, robot

plot = pytest.importorskip("deconflict.sweep.plot", exc_type=ImportError)

CROSSING = Forecasts.joined(
    [
        robot([0], [50], [50], 0, (1, 1)),
        robot([0, 10], [-5, 5], [0, 0], 0, (1.0, 0.5)),
        robot([0, 10], [0, 0], [-5, 5], np.pi / 2, (2.0, 0.5)),
    ]
)


def drawn(forecasts: Forecasts) -> Any:
    found = sweep(forecasts, now_s=NOW_S, clearance_m=0.0)
    assert found.pairs.tolist() == [[1, 2]]
    return plot.draw(forecasts, found, 0, now_s=NOW_S)


def shown(colour: tuple[float, ...]) -> str:
    return "#" + "".join(f"{round(255 * part):02x}" for part in colour[:3])


def shaded(axes: Any, colour: str) -> shapely.Geometry:
    (patch,) = [patch for patch in axes.patches if shown(patch.get_facecolor()) == colour]
    return shapely.union_all([shapely.Polygon(ring) for ring in patch.get_path().to_polygons()])


def test_shades_what_each_envelope_sweeps() -> None:
    axes = drawn(CROSSING)
    for colour, swept in zip(
        plot.COLOURS, (shapely.box(-5.5, -0.25, 5.5, 0.25), shapely.box(-0.25, -6, 0.25, 6)), strict=True
    ):
        assert shaded(axes, colour).symmetric_difference(swept).area < 1e-6


def test_shows_both_robots_at_their_first_contact() -> None:
    axes = drawn(CROSSING)
    bold = [line for line in axes.lines if line.get_linewidth() == 2.0]
    first, other = (shapely.Polygon(line.get_xydata()) for line in bold)
    assert first.distance(other) <= 1e-3
    assert first.intersection(other).area < 1e-2
    (label,) = axes.texts
    assert label.get_text() == "first contact, 4.25 s"
    assert shapely.Point(label.xy).distance(first) <= 1e-3
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["robot 1", "robot 2"]


def test_leaves_out_where_a_robot_is_on_another_floor_or_not_there_yet() -> None:
    late = robot([2, 10], [0, 0], [-3, 5], np.pi / 2, (2.0, 0.5))
    rides = robot([0, 7, 8, 10], [-5, 2, 3, 5], [0] * 4, 0, (1.0, 0.5), floor=[0, 1, 1, 1])
    forecasts = Forecasts.joined([CROSSING.single(0), CROSSING.single(1), late])
    assert shaded(drawn(forecasts), plot.COLOURS[1]).bounds[1] == pytest.approx(-4)
    stays = Forecasts.joined([CROSSING.single(0), robot([0], [0], [0], 0, (1.0, 0.5)), rides])
    found = sweep(stays, now_s=NOW_S, clearance_m=4.6)
    assert shaded(plot.draw(stays, found, 0, now_s=NOW_S), plot.COLOURS[1]).bounds[2] == pytest.approx(-4.5)


def test_draws_into_the_axes_given() -> None:
    axes = plot.Figure().add_subplot()
    found = sweep(CROSSING, now_s=NOW_S, clearance_m=0.0)
    assert plot.draw(CROSSING, found, 0, now_s=NOW_S, axes=axes) is axes


def test_a_conflict_that_was_not_found_cannot_be_drawn() -> None:
    with pytest.raises(IndexError):
        plot.draw(CROSSING, sweep(CROSSING, now_s=NOW_S, clearance_m=0.0), 1, now_s=NOW_S)
