"""The drawings of a replay's report. Each draws a part of the result of `metrics/replay/replay.py`."""

from collections import Counter
from collections.abc import Mapping, Sequence
from math import cos, sin, sqrt
from typing import Any

from metrics.report.svg import Chart, Point, fitted

Part = Mapping[str, Any]
COLOURS = 6
"""Number of colours that a reader can distinguish."""
SCALES_M = (20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2)
"""Possible lengths of a scale bar."""
LEADS_S = 12
"""Number of bars, one for each whole second of lead time. The last also counts longer times."""


def reliability(rows: Sequence[Part]) -> str:
    """Published probability against the share that came true. The area of a dot is its share of the samples."""
    chart = Chart((0.0, 1.0), (0.0, 1.0))
    chart.axes("probability published", "share that came true")
    chart.line([(0.0, 0.0), (1.0, 1.0)], "ideal")
    most = max((row["samples"] for row in rows), default=1)
    chart.line([(row["probability"], row["came_true"]) for row in rows], "line c0")
    for row in rows:
        title = f"published {row['probability']:.2f}, came true {row['came_true']:.2f}, {row['samples']} samples"
        chart.dot((row["probability"], row["came_true"]), 3 + 5 * sqrt(row["samples"] / most), "dot c0", title)
    return chart.drawn("Reliability diagram")


def lead_times(leads_s: Sequence[float]) -> str:
    """Number of predicted encounters by lead time."""
    counts = Counter(min(max(int(lead), 0), LEADS_S - 1) for lead in leads_s)
    chart = Chart((0.0, LEADS_S), (0.0, max(counts.values(), default=1) * 1.05))
    chart.axes("lead time, seconds", "encounters")
    for second, count in sorted(counts.items()):
        name = f"{second} s and more" if second == LEADS_S - 1 else f"{second} to {second + 1} s"
        chart.box((second + 0.08, 0.0), (second + 0.92, count), "bar", f"{name}: {count}")
    return chart.drawn("Distribution of lead times")


def errors(models: Sequence[Part]) -> str:
    """Median (line) and p90 (dashed) of the distance by horizon, in one colour for each vendor and model."""
    shown = models[:COLOURS]
    values = [row["distance_p90_m"] or 0.0 for model in shown for row in model["horizons"]]
    chart = Chart((0.0, 10.0), (0.0, max(values, default=1.0) or 1.0))
    chart.axes("seconds ahead", "metres off")
    for number, model in enumerate(shown):
        for share, style in (("median", "line"), ("p90", "dashes")):
            name = f"distance_{share}_m"
            points = [(row["horizon_s"], row[name]) for row in model["horizons"] if row[name] is not None]
            chart.line([(0.0, 0.0), *points], f"{style} c{number}")
    return chart.drawn("Forecast error by horizon")


def heat(alerts: Sequence[tuple[Point, str]]) -> str:
    """Where conflicts were predicted. A darker cell has more; its title says how many came true."""
    xs, ys = [x for (x, _), _ in alerts], [y for (_, y), _ in alerts]
    reach = max(max(xs) - min(xs), max(ys) - min(ys), 8.0)
    cell = next(size for size in (0.5, 1.0, 2.0, 5.0, 10.0, 50.0, reach) if reach / size <= 60)
    found: dict[tuple[int, int], Counter[str]] = {}
    for (x, y), outcome in alerts:
        found.setdefault((int(x // cell), int(y // cell)), Counter())[outcome] += 1
    low = (min(xs) - cell, min(ys) - cell)
    high = (max(xs) + cell, max(ys) + cell)
    width = round(min(max(380 * (high[0] - low[0]) / (high[1] - low[1]), 200), 700)) + 80
    chart = fitted([low, high], width, 460, 40)
    chart.axes("metres", "metres")
    most = max(sum(counts.values()) for counts in found.values())
    for (column, row), counts in sorted(found.items()):
        total = sum(counts.values())
        title = f"({column * cell:g}, {row * cell:g}): {total} alerts, {counts['y']} came true"
        corner = (column * cell, row * cell)
        chart.box(corner, (corner[0] + cell, corner[1] + cell), "heat", title, 0.15 + 0.85 * total / most)
    return chart.drawn("Where conflicts were predicted")


def scene(document: Part) -> str:
    """Two robots with their trailers around the moment when they were nearest: their tracks, and outlines each second,
    filled at that moment."""
    robots = [[(_track(body["track"]), body["outlines_m"]) for body in bodies] for bodies in document["bodies"]]
    room = [
        corner
        for bodies in robots
        for track, outlines in bodies
        for pose in track
        for outline in outlines
        for corner in _placed(outline, pose)
    ]
    chart = fitted(room, 200, 200, 16)
    for number, bodies in enumerate(robots):
        chart.line([(x, y) for x, y, _ in bodies[0][0]], f"line c{number}")
        for track, outlines in bodies:
            for pose in track[document["nearest"] % 5 :: 5]:
                for outline in outlines:
                    chart.polygon(_placed(outline, pose), f"outline c{number}")
    for number, bodies in enumerate(robots):
        for track, outlines in bodies:
            for outline in outlines:
                corners = _placed(outline, track[document["nearest"]])
                chart.polygon(corners, f"envelope c{number}", document["robots"][number])
    _scale(chart)
    return chart.drawn("Two envelopes where they were nearest")


def _scale(chart: Chart) -> None:
    """Draw a bar in the lower left corner with its length in metres."""
    metre = chart.at(1.0, 0.0)[0] - chart.at(0.0, 0.0)[0]
    length_m = next((scale_m for scale_m in SCALES_M if scale_m * metre <= 0.35 * chart.width), SCALES_M[-1])
    end = 8 + length_m * metre
    y = chart.height - 6
    chart.marks.append(f'<path class="scale" d="M8 {y - 4}V{y}H{end:.1f}V{y - 4}"/>')
    chart.text(end + 4, y, f"{length_m:g} m", "tick", "start")


def _placed(outline: Sequence[Point], pose: tuple[float, float, float]) -> list[Point]:
    """The corners of an outline that was drawn around a pose."""
    (x, y, yaw), points = pose, []
    for ahead, left in outline:
        points.append((x + cos(yaw) * ahead - sin(yaw) * left, y + sin(yaw) * ahead + cos(yaw) * left))
    return points


def _track(text: str) -> list[tuple[float, float, float]]:
    poses = []
    for pose in text.split(";"):
        x, y, yaw = map(float, pose.split())
        poses.append((x, y, yaw))
    return poses
