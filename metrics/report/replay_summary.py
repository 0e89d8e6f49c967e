"""The result of a replay in a few lines for the terminal: what was warned of, how far ahead, and where in vain."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from ingest.languages.visible_text import visible
from metrics.report.html_cells import Part, moment

CELL_M = 5.0
"""Alerts are counted by squares of this side."""


def summary(result: Part, written: Sequence[Path]) -> str:
    """`written` are the files that the replay wrote."""
    return "\n".join([*map(visible, _lines(result)), *(f"Wrote {path}" for path in written), ""])


def _lines(result: Part) -> Iterator[str]:
    score = result["scores"][0]
    alerts = score["warnings"]
    minutes = result["span_s"] / 60
    yield f"{result['messages']:,} messages of {result['robots']:,} robots in {minutes:.1f} min"
    yield (
        f"{alerts['alerts']} conflicts were warned of at a clearance of {score['clearance_m']:g} m: "
        f"{alerts['true']} came true, {alerts['in_progress']} were in progress already, "
        f"{alerts['in_vain']} were in vain, {alerts['ordered']} were waits within a fleet, "
        f"{alerts['heeded']} were advised waits, {alerts['repeated']} were repeated, {alerts['unknown']} unknown"
    )
    for name, text in (("stops", "stops of robots for others"), ("encounters", "encounters within the clearance")):
        fresh = alerts[name]
        if fresh["fresh"]:
            yield (
                f"Of {fresh['fresh']} fresh {text}, {_percent(fresh['told_2_s'])} were warned of 2 s ahead, "
                f"{_percent(fresh['told_4_s'])} 4 s, {_percent(1 - fresh['told_at_any_time'])} not at all"
            )
    if score["lead_time_s"]:
        ahead = score["lead_time_s"]
        yield f"Warned {ahead['median']:.1f} s ahead in the median (a tenth less than {ahead['p10']:.1f} s)"
    yield from _worst(result, score)


def _worst(result: Part, score: Part) -> Iterator[str]:
    """The pair of vendors and the place with the most warnings in vain, and the nearest moment."""
    pairs = [row for row in score["warnings"]["by_vendor_pair"] if row["in_vain"]]
    if pairs:
        worst = max(pairs, key=lambda row: row["in_vain"])
        names = " and ".join(worst["vendors"])
        yield f"Most in vain between {names}: {worst['in_vain']} of {worst['alerts']}"
    cases, cells = score["cases"], Counter[tuple[float, float, str]]()
    for place, came in zip(cases["places"], cases["came_true"], strict=False):
        if came == "n":
            x, y, floor = place.split(" ", 2)
            cells[round(float(x) / CELL_M) * CELL_M, round(float(y) / CELL_M) * CELL_M, floor] += 1
    floors = {each["floor"]: each["floor_name"] for each in result["nearest"]}
    for (x_m, y_m, floor), count in cells.most_common(1):
        yield f"Most without an encounter near ({x_m:g}, {y_m:g}){_on(floors.get(floor, floor))}: {count}"
    if result["nearest"]:
        near = result["nearest"][0]
        warned = "without a warning" if near["warned_s"] is None else f"warned of {near['warned_s']:.1f} s before"
        yield (
            f"Nearest: {' and '.join(near['names'])}, {near['separation_m']:.2f} m{_on(near['floor_name'])} at "
            f"{moment(near['at'])}, {warned}"
        )


def _on(floor_name: str) -> str:
    """The floor in a sentence; nothing if it has no name."""
    return f" on {floor_name}" if floor_name else ""


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"
