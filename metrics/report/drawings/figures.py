"""The drawings of a replay's report. Each draws a part of the result of `metrics/replay/replay.py`."""

from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from math import ceil, cos, sin, sqrt
from typing import Any

from metrics.report.drawings.svg import Chart, Point, fitted

Part = Mapping[str, Any]
COLOURS = 6
"""Number of colours that a reader can distinguish."""
SCALES_M = (20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2)
"""Possible lengths of a scale bar."""
RAISED, HAPPENED = ("true", "in_vain", "other"), ("warned", "missed")
STACKED = {
    "true": "warnings came true",
    "in_vain": "warnings in vain",
    "other": "warnings not judged",
    "warned": "stops and encounters with a warning",
    "missed": "stops and encounters without a warning",
}
"""What the timeline shows, the first nearest to its line."""
BINS_S, MOST_BINS, MOST_TIMES = (60.0, 120.0, 300.0, 600.0, 900.0, 1800.0, 3600.0, 21600.0, 86400.0), 72, 14
MINUTE_S = 60.0
LEADS_S = 12
"""Number of bars, one for each whole second of lead time. The last also counts longer times."""


def reliability(rows: Sequence[Part], likely: Sequence[Part] = ()) -> str:
    """Published probability against the share that came true, of all (blue) and of the likely (orange). The area of a
    dot is its share of the samples."""
    chart = Chart((0.0, 1.0), (0.0, 1.0))
    chart.axes("probability published", "share that came true")
    chart.line([(0.0, 0.0), (1.0, 1.0)], "ideal")
    for colour, bins in (("c0", rows), ("c1", likely)):
        most = max((row["samples"] for row in bins), default=1)
        chart.line([(row["probability"], row["came_true"]) for row in bins], f"line {colour}")
        for row in bins:
            title = f"published {row['probability']:.2f}, came true {row['came_true']:.2f}, {row['samples']} samples"
            radius = 3 + 5 * sqrt(row["samples"] / most)
            chart.dot((row["probability"], row["came_true"]), radius, f"dot {colour}", title)
    return chart.drawn("Reliability diagram")


def lead_times(leads_s: Sequence[float]) -> str:
    """Number of predicted encounters by lead time."""
    counts = Counter(min(max(int(lead), 0), LEADS_S - 1) for lead in leads_s)
    chart = Chart((0.0, LEADS_S), (0.0, max(counts.values(), default=1) * 1.05))
    labels = [(float(second), f"{second}") for second in range(0, LEADS_S - 1, 2)]
    chart.axes("lead time, seconds", "encounters", [*labels, (LEADS_S - 0.5, f"{LEADS_S - 1}+")])
    for second, count in sorted(counts.items()):
        name = f"{second} s and more" if second == LEADS_S - 1 else f"{second} to {second + 1} s"
        chart.box((second + 0.08, 0.0), (second + 0.92, count), "bar", f"{name}: {count}")
    return chart.drawn("Distribution of lead times")


def errors(models: Sequence[Part], share: str) -> str:
    """`median` or `p90` of the distance by horizon, in one colour for each vendor and model."""
    shown, name = models[:COLOURS], f"distance_{share}_m"
    values = [row[name] or 0.0 for model in shown for row in model["horizons"]]
    chart = Chart((0.0, 10.0), (0.0, max(values, default=1.0) or 1.0))
    chart.axes("seconds ahead", "metres off")
    for number, model in enumerate(shown):
        points = [(row["horizon_s"], row[name]) for row in model["horizons"] if row[name] is not None]
        chart.line([(0.0, 0.0), *points], f"line c{number}")
    return chart.drawn(f"Forecast error by horizon, {share}")


def timeline(minutes: Sequence[Part]) -> str:
    """Warnings by the time at which they were raised, upwards, and stops and encounters, downwards."""
    first_s, last_s = minutes[0]["at_s"], minutes[-1]["at_s"] + MINUTE_S
    every_s = next((bin_s for bin_s in BINS_S if (last_s - first_s) / bin_s <= MOST_BINS), BINS_S[-1])
    bins: dict[float, Counter[str]] = {}
    for row in minutes:
        counts = {name: row[name] for name in (*RAISED, *HAPPENED)}
        bins.setdefault(row["at_s"] // every_s * every_s, Counter()).update(counts)
    up, down = (max(sum(bin_[name] for name in names) for bin_ in bins.values()) for names in (RAISED, HAPPENED))
    first_s, last_s = min(bins), max(bins) + every_s
    chart = Chart((first_s, last_s), (-1.1 * max(down, 1), 1.1 * max(up, 1)), 1140, 260, (12, 14, 40, 48), True)
    count = round((last_s - first_s) / every_s)
    step = ceil(count / MOST_TIMES)
    times = [(at_s, _clock(at_s)) for at_s in (first_s + every_s * number for number in range(0, count, step))]
    chart.axes("", "events | warnings", times)
    for at_s, counts in bins.items():
        when = f"{_clock(at_s)} to {_clock(at_s + every_s)}"
        for names, sign in ((RAISED, 1), (HAPPENED, -1)):
            begin = 0
            for name in names:
                ends = sorted((sign * begin, sign * (begin + counts[name])))
                box = (at_s + 0.06 * every_s, ends[0]), (at_s + 0.94 * every_s, ends[1])
                chart.box(*box, f"{name}", f"{when}: {counts[name]} {STACKED[name]}")
                begin += counts[name]
    chart.line([(first_s, 0.0), (last_s, 0.0)], "zero")
    return chart.drawn("Warnings and events by time")


def _clock(at_s: float) -> str:
    return datetime.fromtimestamp(at_s, UTC).strftime("%H:%M")


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
        chart.polygon(_nose(bodies[0][1], bodies[0][0][document["nearest"]]), f"nose c{number}")
        for track, outlines in bodies:
            for outline in outlines:
                corners = _placed(outline, track[document["nearest"]])
                chart.polygon(corners, f"envelope c{number}", document["robots"][number])
    _scale(chart)
    return chart.drawn("Two envelopes where they were nearest")


def _nose(outlines: Sequence[Sequence[Point]], pose: tuple[float, float, float]) -> list[Point]:
    """A triangle in front of a robot, which shows where it heads."""
    front_m = max(ahead for outline in outlines for ahead, _ in outline)
    half_m = max(left for outline in outlines for _, left in outline)
    return _placed([(front_m + half_m, 0.0), (front_m, half_m / 2), (front_m, -half_m / 2)], pose)


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
