"""Figures of several services side by side as a Markdown table."""

from collections.abc import Sequence

from benchmarks.planned_floors.scoring.figure import Figure


def table(by_service: dict[str, dict[str, Figure]]) -> str:
    """A Markdown table: a row for each figure, a column for each service."""
    services = list(by_service)
    names = list(dict.fromkeys(name for figures in by_service.values() for name in figures))
    rows = [["figure", "cases", *services]]
    for name in names:
        found = [by_service[service].get(name) for service in services]
        if all(figure is None or figure["value"] is None for figure in found):
            continue
        cases = {figure["of"] for figure in found if figure}
        rows.append([name, "/".join(map(str, sorted(cases))), *map(cell, found)])
    return aligned(rows)


def aligned(rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table of cells. The first row is its heading."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = [
        "| " + " | ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)) + " |" for row in rows
    ]
    return "\n".join([lines[0], "|" + "|".join("-" * (width + 2) for width in widths) + "|", *lines[1:]])


def cell(figure: Figure | None) -> str:
    """The value and its interval; a dash if it is unknown."""
    if not figure or figure["value"] is None:
        return "-"
    value, interval = figure["value"], figure["interval"]
    digits = 1 if value >= 2 else 2
    if not interval:
        return f"{value:.{digits}f}"
    return f"{value:.{digits}f} ({interval[0]:.{digits}f}-{interval[1]:.{digits}f})"
