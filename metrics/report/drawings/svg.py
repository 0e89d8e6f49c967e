"""Drawings as SVG text: a chart with axes and marks. The same input gives the same bytes."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from html import escape
from math import ceil, floor, log10

Point = tuple[float, float]


@dataclass(slots=True)
class Chart:
    """A plot of `width` by `height` with space for axes. Marks are added in data coordinates."""

    x_range: tuple[float, float]
    y_range: tuple[float, float]
    width: int = 560
    height: int = 320
    margin: tuple[int, int, int, int] = (12, 14, 40, 48)
    """Top, right, bottom, left."""
    mirrored: bool = False
    """Whether values below 0 are counts downwards."""
    marks: list[str] = field(default_factory=list)

    def at(self, x: float, y: float) -> Point:
        """The position in the drawing of a point of the data."""
        top, right, bottom, left = self.margin
        (x0, x1), (y0, y1) = self.x_range, self.y_range
        across = (x - x0) / ((x1 - x0) or 1.0)
        up = (y - y0) / ((y1 - y0) or 1.0)
        return left + across * (self.width - left - right), self.height - bottom - up * (self.height - top - bottom)

    def line(self, points: Iterable[Point], style: str) -> None:
        placed = " ".join(f"{x:.1f},{y:.1f}" for x, y in (self.at(*point) for point in points))
        self.marks.append(f'<polyline class="{style}" points="{placed}"/>')

    def polygon(self, points: Iterable[Point], style: str, title: str = "") -> None:
        placed = " ".join(f"{x:.1f},{y:.1f}" for x, y in (self.at(*point) for point in points))
        self.marks.append(f'<polygon class="{style}" points="{placed}">{_title(title)}</polygon>')

    def link(self, target: str, name: str, point: Point, style: str, title: str) -> None:
        """A dot named `name` that leads to another part of the page."""
        x, y = self.at(*point)
        self.marks.append(
            f'<a href="#{escape(target)}"><circle id="{escape(name)}" class="{style}" cx="{x:.1f}" cy="{y:.1f}" r="5">'
            f"{_title(title)}</circle></a>"
        )

    def dot(self, point: Point, radius: float, style: str, title: str = "") -> None:
        x, y = self.at(*point)
        self.marks.append(
            f'<circle class="{style}" cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}">{_title(title)}</circle>'
        )

    def box(self, low: Point, high: Point, style: str, title: str = "", opacity: float = 1.0) -> None:
        (x0, y0), (x1, y1) = self.at(*low), self.at(*high)
        self.marks.append(
            f'<rect class="{style}" x="{x0:.1f}" y="{y1:.1f}" width="{x1 - x0:.1f}" height="{y0 - y1:.1f}"'
            f' fill-opacity="{opacity:.2f}">{_title(title)}</rect>'
        )

    def text(self, x: float, y: float, content: str, style: str, anchor: str = "middle") -> None:
        """Add text at a position of the drawing, not of the data."""
        self.marks.append(
            f'<text class="{style}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(content)}</text>'
        )

    def axes(self, x_label: str, y_label: str, x_ticks: Sequence[tuple[float, str]] | None = None) -> None:
        """Add ticks with grid lines, and the labels of the axes. `x_ticks` are places and texts of ticks."""
        top, right, bottom, left = self.margin
        for value, label in x_ticks or [(value, f"{value:g}") for value in ticks(*self.x_range)]:
            x, y = self.at(value, self.y_range[0])
            self.marks.append(f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{top}" y2="{y:.1f}"/>')
            self.text(x, y + 14, label, "tick")
        for value in ticks(*self.y_range):
            x, y = self.at(self.x_range[0], value)
            self.marks.append(f'<line class="grid" x1="{x:.1f}" x2="{self.width - right}" y1="{y:.1f}" y2="{y:.1f}"/>')
            self.text(x - 6, y + 4, f"{abs(value) if self.mirrored else value:g}", "tick", "end")
        self.text((left + self.width - right) / 2, self.height - 8, x_label, "axis")
        middle = (top + self.height - bottom) / 2
        self.marks.append(
            f'<text class="axis" transform="translate(13 {middle:.1f}) rotate(-90)" text-anchor="middle">'
            f"{escape(y_label)}</text>"
        )

    def drawn(self, name: str) -> str:
        """The drawing as SVG. `name` is its description for screen readers."""
        return (
            f'<svg role="img" aria-label="{escape(name)}" viewBox="0 0 {self.width} {self.height}"'
            f' width="{self.width}" height="{self.height}">{"".join(self.marks)}</svg>'
        )


def ticks(low: float, high: float, about: int = 5) -> Sequence[float]:
    """Round numbers from `low` to `high`."""
    if not high > low:
        return [low]
    rough = (high - low) / about
    scale: float = 10 ** floor(log10(rough))
    step = next(factor * scale for factor in (1, 2, 5, 10) if factor * scale >= rough)
    return [round(n * step, 10) for n in range(ceil(low / step - 1e-9), floor(high / step + 1e-9) + 1)]


def fitted(points: Sequence[Point], width: int, height: int, margin: int = 8) -> Chart:
    """A chart without axes that contains all points, with the same scale on both axes."""
    xs, ys = [x for x, _ in points], [y for _, y in points]
    inner_x, inner_y = width - 2 * margin, height - 2 * margin
    metre = min(inner_x / max(max(xs) - min(xs), 1.0), inner_y / max(max(ys) - min(ys), 1.0))
    half_x, half_y = inner_x / metre / 2, inner_y / metre / 2
    x, y = (max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2
    return Chart((x - half_x, x + half_x), (y - half_y, y + half_y), width, height, (margin,) * 4)


def _title(content: str) -> str:
    return f"<title>{escape(content)}</title>" if content else ""
