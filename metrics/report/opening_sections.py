"""The first page of a replay's report, for a meeting: what happened, when and where, and each case to look into.

A picture of the floor shows what stands on it, where warnings were raised, and dots that lead to the listed cases.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from urllib.parse import quote

from deconflict.settings.shared_places import Resource, Zone, outlines
from deconflict.settings.site import Site
from deconflict_client.counted_nouns import count_of
from metrics.report.drawings import figures
from metrics.report.drawings.svg import Chart, Point, fitted
from metrics.report.html_cells import Part, figure, linked_table, moment, number, percent
from metrics.report.replay_summary import findings, first_sentences, place_texts
from metrics.scoring.bootstrap import Interval
from metrics.scoring.warnings.warning_quality import WarningQuality

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


EVENTS = {"stop": "one stopped or swerved for the other", "encounter": "came within the clearance"}
KEY = '<span class="key {}"></span>'


def opening(result: Part, site: Site, page_url: str) -> Iterator[str]:
    """`page_url` is the address of the operator's page, to which cases lead; empty if there is none."""
    warnings = result["scores"][0]["warnings"]
    yield f'<p class="lead">{escape(first_sentences(result))}</p>{_tiles(result, warnings)}'
    yield f'<p class="note">{escape(_source(result))}</p>'
    yield f"<ul>{''.join(f'<li>{escape(sentence)}</li>' for sentence in findings(result, site))}</ul>"
    if warnings["by_minute"]:
        yield f"<h2>The course of the log</h2>{_timeline(warnings['by_minute'])}"
    if drawn := _floors(result, warnings, site):
        yield f"<h2>Where</h2>{drawn}"
    yield "<h2>What to look into</h2>" + _lists(warnings["listed"], page_url, site)


def _tiles(result: Part, warnings: Part) -> str:
    """The key figures, each with what it means."""
    quality, situations = WarningQuality.of(warnings), result["situations"]
    clearance_m, ahead = result["scores"][0]["clearance_m"], quality.ahead_by_s
    stops = f"{count_of(quality.stops, 'stop or swerve', 'stops or swerves')} for another robot"
    met = f"{stops}, {quality.encounters:,} encounters within {clearance_m:g} m"
    early = f"{quality.warned_of_2_s:,} at least 2 s ahead, {quality.warned_of_4_s:,} at least 4 s"
    median = f"; ahead by {ahead['median']:.1f} s in the median" if ahead else ""
    warned = f"{quality.warned_of:,} with a warning in the 10 s before: {early}{median}"
    rate = f"{quality.warnings:,} in {_hours(quality.robot_hours)} of robots on the floor"
    came = percent(situations["came_true"])
    useful = f"what people see; {came} of those judged came true, {situations['heeded']:,} were prevented by advice"
    tiles = (
        (f"{quality.events:,}", "times in each other's way", met),
        (percent(quality.share_warned_of), "warned of", warned),
        (percent(quality.share_came_true), "of warnings came true", _true(quality, warnings["intervals"]["precision"])),
        (number(quality.warnings_per_robot_hour), "warnings per robot-hour", rate),
        (f"{situations['situations']:,}", "situations", useful),
    )
    drawn = "".join(f"<div><b>{value}</b><span>{name}</span><small>{text}</small></div>" for value, name, text in tiles)
    return f'<div class="tiles">{drawn}</div>'


def _true(quality: WarningQuality, interval: Interval) -> str:
    between = f" (95 % interval {percent(interval[0])} to {percent(interval[1])})" if interval else ""
    others = f"{quality.in_vain:,} in vain, {quality.not_judged:,} not judged"
    return f"{quality.came_true:,} of {quality.judged:,} that are judged{between}; {others}"


def _hours(hours: float) -> str:
    return f"{hours:.1f} hours" if hours >= 1 else f"{60 * hours:.0f} minutes"


def _source(result: Part) -> str:
    late = (
        f" {count_of(result['late_messages'], 'message comes', 'messages come')} after messages that were received up "
        f"to {result['late_by_s']:g} s later; each was read in the order of the log."
        if "late_messages" in result
        else ""
    )
    when = f" from {moment(result['from'])} to {moment(result['until'])}" if "from" in result else ""
    return (
        f"{count_of(result['messages'], 'message')}{when}, through the engine that the live service uses.{late}"
        " Advisory, not safety rated."
    )


def _timeline(minutes: Sequence[Part]) -> str:
    legend = (
        f"{KEY.format('true')}warnings that came true {KEY.format('vain')}in vain {KEY.format('other')}not judged."
        f" Below the line: {KEY.format('warned')}stops and encounters with a warning {KEY.format('missed')}without."
        " Times in UTC"
    )
    return f"<figure>{figures.timeline(minutes)}<figcaption>{legend}</figcaption></figure>"


def _floors(result: Part, warnings: Part, site: Site) -> str:
    floors = _drawn_floors(warnings["listed"], result["floors"], site)
    drawn = [figure(floor_picture(floor), f"{floor.name}. Warnings: {len(floor.warnings):,}") for floor in floors]
    if not drawn:
        return ""
    legend = (
        f'<p class="note">From above, x to the right, y up. {KEY.format("heat")}warnings, darker where there were more'
        f" {KEY.format('vain')}in vain {KEY.format('missed')}missed. Point at a cell or a dot to read what it is; a dot"
        " leads to its row below.</p>"
    )
    return f'<div class="row">{"".join(drawn)}</div>{legend}'


def _drawn_floors(listed: Part, names: Mapping[str, str], site: Site) -> list[DrawnFloor]:
    """The floors on which something is to be shown."""
    floors: dict[str, DrawnFloor] = {}

    def floor(floor_id: str) -> DrawnFloor:
        return floors.setdefault(floor_id, DrawnFloor(names.get(floor_id) or floor_id[:8] or "no floor"))

    for place, outcome in zip(listed["places"], listed["came_true"], strict=True):
        if place:
            x, y, floor_id = place.split(" ", 2)
            floor(floor_id).warnings.append(((float(x), float(y)), outcome))
    for style, prefix, cases in (("vain", "v", listed["in_vain"]), ("missed", "m", listed["missed"])):
        for row, case in enumerate(cases, 1):
            if case["x_m"] is not None:
                point, text = (case["x_m"], case["y_m"]), f"{prefix.upper()}{row}: {' and '.join(case['names'])}"
                floor(case["floor"]).dots.append((f"dot {style}", f"{prefix}{row}", point, text))
    for floor_id, drawn in floors.items():
        drawn.outlines += _outlines(site, floor_id)
    return [floors[floor_id] for floor_id in sorted(floors)]


def _outlines(site: Site, floor_id: str) -> Iterator[tuple[str, str, Sequence[tuple[float, float]]]]:
    for obstacle in site.obstacles:
        if floor_id == (obstacle.floor or site.datums[0].id):
            yield "obstacle", obstacle.name or obstacle.kind, obstacle.outline_m
    places: list[Resource | Zone] = [*site.resources, *site.zones]
    for place in places:
        for datum, outline in outlines(place):
            if datum == floor_id:
                yield "shared", place.label, outline


def _lists(listed: Part, page_url: str, site: Site) -> str:
    missed = [
        [*_case("m", row, case, page_url), EVENTS[case["event"]], place]
        for row, (case, place) in enumerate(_placed(listed["missed"], site), 1)
    ]
    in_vain = [
        [
            *_case("v", row, case, page_url),
            case["encounter_class"].replace("_", " "),
            place,
            f"{case['predicted_in_s']:.1f}",
            f"{case['open_s']:.1f}",
        ]
        for row, (case, place) in enumerate(_placed(listed["in_vain"], site), 1)
    ]
    head = ("", "when", "robots", "what", "place")
    return (
        f"<h3>Without a warning: {_count(listed, 'missed')}</h3>"
        + (linked_table("m", head, missed) if missed else "<p>None.</p>")
        + f"<h3>Warnings in vain: {_count(listed, 'in_vain')}</h3>"
        + (linked_table("v", (*head, "predicted in, s", "open for, s"), in_vain) if in_vain else "<p>None.</p>")
    )


def _count(listed: Part, name: str) -> str:
    left_out = listed[f"{name}_left_out"]
    return f"{len(listed[name]) + left_out:,}" + (f", the first {len(listed[name]):,} of them" if left_out else "")


def _case(prefix: str, row: int, case: Part, page_url: str) -> list[str]:
    """The first cells of a case, as HTML: a link to its dot, and when, as a link to the operator's page."""
    when = f"{case['at'][11:21]}, {case['into_s']:.0f} s"
    if page_url:
        target = f"{page_url}#at={quote(case['at'])}&floor={quote(case['floor'])}"
        when = f'<a href="{escape(target)}">{when}</a>'
    names = escape(" and ".join(case["names"]))
    label = f"{prefix.upper()}{row}"
    dot = label if case["x_m"] is None else f'<a href="#dot-{prefix}{row}">{label}</a>'
    return [dot, when, names]


def _placed(cases: Sequence[Part], site: Site) -> Iterator[tuple[Part, str]]:
    """Each case, and its place as HTML, with the coordinates."""
    for case, place in zip(cases, place_texts(site, cases), strict=True):
        shown = place if case["x_m"] is None or "near (" in place else f"{place} ({case['x_m']:.1f}, {case['y_m']:.1f})"
        yield case, escape(shown)
