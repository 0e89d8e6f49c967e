"""Figures of several services side by side as a Markdown table."""

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
        rows.append([name, "/".join(map(str, sorted(cases))), *map(_cell, found)])
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = [
        "| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |" for row in rows
    ]
    return "\n".join([lines[0], "|" + "|".join("-" * (width + 2) for width in widths) + "|", *lines[1:]])


def _cell(figure: Figure | None) -> str:
    if not figure or figure["value"] is None:
        return "-"
    value, interval = figure["value"], figure["interval"]
    digits = 1 if value >= 2 else 2
    if not interval:
        return f"{value:.{digits}f}"
    return f"{value:.{digits}f} ({interval[0]:.{digits}f}-{interval[1]:.{digits}f})"
