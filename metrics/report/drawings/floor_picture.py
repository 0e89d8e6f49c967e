"""A picture of a floor: what stands on it, where warnings were raised, and dots that lead to the listed cases."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from deconflict_client.counted_nouns import count_of
from metrics.report.drawings.svg import Chart, Point, fitted

CELLS_M = (0.5, 1.0, 2.0, 5.0, 10.0, 50.0)
WIDTH, MOST_HIGH = 560, 620
LEAST_M, MARGIN_M = 12.0, 1.0
"""A picture shows at least so much of the floor, and so much around what is on it."""
MOST_NUMBERED = 25
"""With more missed events, their dots have no number."""


@dataclass(slots=True)
class DrawnFloor:
    """What is drawn of one floor, in metres of its frame."""

    name: str
    outlines: list[tuple[str, str, Sequence[Point]]] = field(default_factory=list)
    """Kind, name and corners of what stands there."""
    warnings: list[tuple[Point, str]] = field(default_factory=list)
    """Each with "y" if it came true, "n" if it was in vain."""
    dots: list[tuple[str, str, Point, str]] = field(default_factory=list)
    """Style, id of the row that it leads to, place and text of each listed case."""

    def points(self) -> list[Point]:
        corners = [corner for _, _, outline in self.outlines for corner in outline]
        return [*corners, *(point for point, _ in self.warnings), *(point for _, _, point, _ in self.dots)]


def floor_picture(floor: DrawnFloor) -> str:
    """A darker cell has more warnings; its title says how many came true."""
    (west, east), (south, north) = (_extent(axis) for axis in zip(*floor.points(), strict=True))
    wide_m, high_m = east - west, north - south
    high = round(min(max((WIDTH - 80) * high_m / wide_m + 80, 220), MOST_HIGH))
    chart = fitted([(west, south), (east, north)], WIDTH, high, 40)
    chart.axes("x, metres →", "y, metres →")
    for kind, name, outline in floor.outlines:
        chart.polygon(outline, f"place {kind}", name)
    _cells(chart, floor.warnings, max(wide_m, high_m))
    numbered = [style for style, *_ in floor.dots if "missed" in style]
    for style, row, point, text in floor.dots:
        chart.link(row, f"dot-{row}", point, style, text)
        if style in numbered and len(numbered) <= MOST_NUMBERED:
            x, y = chart.at(*point)
            chart.text(x + 6, y + 3, row.upper(), "mark", "start")
    return chart.drawn(f"{floor.name}, from above")


def _extent(values_m: Sequence[float]) -> tuple[float, float]:
    """The values with a margin, or more around them if they are close together."""
    middle, half_m = (min(values_m) + max(values_m)) / 2, (max(values_m) - min(values_m)) / 2
    half_m = max(half_m + MARGIN_M, LEAST_M / 2)
    return middle - half_m, middle + half_m


def _cells(chart: Chart, warnings: Sequence[tuple[Point, str]], reach_m: float) -> None:
    cell = next((size for size in CELLS_M if reach_m / size <= 60), reach_m)
    found: dict[tuple[int, int], Counter[str]] = {}
    for (x, y), outcome in warnings:
        found.setdefault((int(x // cell), int(y // cell)), Counter())[outcome] += 1
    most = max((counts.total() for counts in found.values()), default=1)
    for (column, row), counts in sorted(found.items()):
        total, corner = counts.total(), (column * cell, row * cell)
        all_warnings = count_of(total, "warning")
        title = f"x {corner[0]:g}, y {corner[1]:g}: {all_warnings}, {counts['y']} came true, {counts['n']} in vain"
        chart.box(corner, (corner[0] + cell, corner[1] + cell), "heat", title, 0.15 + 0.6 * total / most)
