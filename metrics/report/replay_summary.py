"""The result of a replay in sentences for people, for the terminal and the top of the report."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from deconflict.advisories.words.place_names import PlaceNames
from deconflict.operator.suggestions.suggestion import minutes
from deconflict.settings.site import DEFAULT, Site
from deconflict_client.counted_nouns import count_of
from deconflict_client.participant_kinds import counted
from ingest.batch import FloorPoint
from ingest.languages.visible_text import visible
from metrics.report.html_cells import Part, moment, percent
from metrics.scoring.warnings.warning_quality import NOT_JUDGED, WarningQuality, not_judged

CELL_M = 5.0
"""Warnings in vain are counted by squares of this side."""


def summary(result: Part, written: Sequence[Path], site: Site = DEFAULT) -> str:
    """For the terminal. `written` are the files that the replay wrote."""
    return "\n".join(
        [first_sentences(result), *map(visible, findings(result, site)), *(f"Wrote {path}" for path in written), ""]
    )


def first_sentences(result: Part) -> str:
    """How often robots got in each other's way, how often the service warned of it, and how often in vain."""
    quality = WarningQuality.of(result["scores"][0]["warnings"])
    floor = f"In {span(result['span_s'])}, {counted(Counter(result['participants']).elements())} of {_vendors(result)}"
    if not quality.events:
        return f"{floor} never got in each other's way. {_outcomes(quality)}"
    warned = f"{quality.warned_of:,} of these ({percent(quality.share_warned_of)})"
    return (
        f"{floor} got in each other's way {_times(quality.events)}. The service warned of {warned},"
        f" of {quality.warned_of_2_s:,} at least 2 s ahead. {_outcomes(quality)}"
    )


def findings(result: Part, site: Site = DEFAULT) -> Iterator[str]:
    """Other outcomes of warnings, what was lost, situations, the worst pair of vendors and place, and the nearest
    moment."""
    alerts = result["scores"][0]["warnings"]
    others = [f"{alerts[key]:,} {text}" for key, text in NOT_JUDGED.items() if alerts[key]]
    if others:
        yield f"Of those not judged, {', '.join(others)}."
    if ahead := WarningQuality.of(alerts).ahead_by_s:
        yield f"Half of the times that were warned of had the warning {ahead['median']:.1f} s ahead or earlier."
    yield from _lost(result)
    if result["situations"]["situations"]:
        yield _situations(result["situations"])
    pairs = [row for row in alerts["by_vendor_pair"] if row["in_vain"]]
    if pairs:
        worst = max(pairs, key=lambda row: row["in_vain"])
        names = " and ".join(dict.fromkeys(worst["vendors"]))
        yield f"Most warnings in vain: between robots of {names}, {worst['in_vain']:,} of {worst['alerts']:,}."
    yield from _worst_place(result, site)
    if result["nearest"]:
        yield _nearest(result["nearest"][0])


def _lost(result: Part) -> Iterator[str]:
    losses = result["losses"]
    total, priced = losses["total"], losses["total"]["cost"] is not None
    if not total["losses"]:
        return
    cost = f", which costs {money(total, losses['currency'])}" if priced else ""
    yield f"Robots and people lost {minutes(total['lost_s'])} to each other{cost}."
    worst = next((row for row in losses["by_place"] if row["place"]), None)
    if worst:
        yield f"More than anywhere else in {worst['place']}: {minutes(worst['lost_s'])}."


def money(row: Part, currency: str) -> str:
    return "-" if row["cost"] is None else f"{row['cost']:.2f} {currency}".strip()


def span(seconds: float) -> str:
    """The length of a log."""
    return f"{seconds / 3600:.1f} hours" if seconds >= 7200 else f"{seconds / 60:.1f} minutes"


def _outcomes(quality: WarningQuality) -> str:
    if not quality.warnings:
        return "There were no warnings."
    in_vain, not_judged = count_of(quality.in_vain, "was", "were"), count_of(quality.not_judged, "is", "are")
    return (
        f"Of its {count_of(quality.warnings, 'warning')}, {quality.came_true:,} came true, "
        f"{in_vain} in vain and {not_judged} not judged."
    )


def _situations(part: Part) -> str:
    at_once = part["open_at_once"]
    return (
        f"Situations for people: {part['situations']:,}. Came true: {part['true']:,}, in vain: {part['in_vain']:,}, not"
        f" judged: {not_judged(part):,} (prevented by advice: {part['heeded']:,}). Open at a time:"
        f" {at_once['median'] or 0:.0f} in the median, {at_once['most'] or 0:.0f} at most."
    )


def place_texts(site: Site, cases: Sequence[Part]) -> list[str]:
    """Where each case was, in the site's names if it has the floor: "in Aisle 3 on Ground hall"."""
    known = {datum.id for datum in site.datums}
    named = [row for row, case in enumerate(cases) if case["floor"] in known and case["x_m"] is not None]
    points = [FloorPoint(cases[row]["floor"], cases[row]["x_m"], cases[row]["y_m"]) for row in named]
    texts = [
        "-" if case["x_m"] is None else f"near ({case['x_m']:.1f}, {case['y_m']:.1f}){_on(case['floor_name'])}"
        for case in cases
    ]
    for row, spot in zip(named, PlaceNames.of(site).describe(points), strict=True):
        texts[row] = spot.text
    return texts


def _worst_place(result: Part, site: Site) -> Iterator[str]:
    listed = result["scores"][0]["warnings"]["listed"]
    cells = Counter[tuple[float, float, str]]()
    for place, outcome in zip(listed["places"], listed["came_true"], strict=True):
        if place and outcome == "n":
            x, y, floor = place.split(" ", 2)
            cells[round(float(x) / CELL_M) * CELL_M, round(float(y) / CELL_M) * CELL_M, floor] += 1
    for (x_m, y_m, floor), count in cells.most_common(1):
        name = result.get("floors", {}).get(floor, "")
        (where,) = place_texts(site, [{"floor": floor, "floor_name": name, "x_m": x_m, "y_m": y_m}])
        yield f"Most of them at one place: {count:,} {where}."


def _nearest(near: Part) -> str:
    warned = "without a warning" if near["warned_s"] is None else f"warned of {near['warned_s']:.1f} s ahead"
    return (
        f"Nearest to each other: {' and '.join(near['names'])}, {near['separation_m']:.2f} m{_on(near['floor_name'])},"
        f" {moment(near['at'])}, {warned}."
    )


def _vendors(result: Part) -> str:
    return count_of(len(result["scores"][0]["by_vendor"]), "vendor")


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count:,} times"


def _on(floor_name: str) -> str:
    """The floor in a sentence; nothing if it has no name."""
    return f" on {floor_name}" if floor_name else ""
