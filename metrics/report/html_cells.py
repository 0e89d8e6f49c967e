"""Tables and values of a page for people."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

Part = Mapping[str, Any]


def table(head: Sequence[str], rows: Sequence[Sequence[str]], words: int = 1) -> str:
    """Cells are escaped; the first `words` columns are words, the others numbers."""
    top = "".join(f"<th>{escape(one)}</th>" for one in head)
    body = "".join(
        "<tr>"
        + "".join(f"<td{'' if n < words else ' class=n'}>{escape(cell)}</td>" for n, cell in enumerate(row))
        + "</tr>"
        for row in rows
    )
    return f'<div class="wide"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


def figure(drawing: str, caption: str) -> str:
    return f"<figure>{drawing}<figcaption>{escape(caption)}</figcaption></figure>"


def maker(one: Part) -> str:
    return f"{one['vendor']} {one['model']}".strip()


def sure(score: Part, name: str) -> str:
    interval = score["intervals"][name]
    return share(score[name]) + (f" ({interval[0]:.2f} to {interval[1]:.2f})" if interval else "")


def share(value: float | None) -> str:
    return number(value, 2)


def number(value: float | None, digits: int = 1) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def spread(value: Part | None) -> str:
    return "-" if value is None else f"{value['median']:.1f} ({value['p10']:.1f} to {value['p90']:.1f})"


def moment(stamp: str) -> str:
    """A time of the log for a person, UTC."""
    return f"{stamp[:10]} {stamp[11:19]} UTC"
