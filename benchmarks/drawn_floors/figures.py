"""The tables and verdicts of many drawn floors."""

from collections.abc import Iterator, Sequence
from statistics import median
from typing import Any

from benchmarks.drawn_floors.others import KINDS

MOST_RATIO, MOST_MORE_S = 3.0, 0.010
"""A pass takes at most so many times that of honest robots, and this much more."""
WORST = 12
Figures = dict[str, Any]
"""What was measured of one floor."""

HEADINGS = (
    "kind", "floors", "given up", "pass, times usual, median", "worst", "over 3", "pairs, times usual, median", "worst",
    "over 3", "pairs of boxes, times usual, median", "worst", "over 3", "slowest pass, ms", "warnings compared",
    "missing", "late", "additional", "severity", "excused", "meetings told ahead: alone", "beside", "missed by others",
    "told of others",
)  # fmt: skip


def row(name: str, floors: Sequence[Figures]) -> str:
    """A row of the table: the figures of some floors."""
    judged = _judged(floors)
    ratios = [[each[key] for each in floors] for key in ("pass_ratio", "pairs_ratio", "boxes_ratio")]
    cells: list[Any] = [name, len(floors), sum(bool(each["failed"]) for each in floors)]
    for ratio in ratios:
        cells += [f"{median(ratio):.1f}", f"{max(ratio):.1f}", sum(each > MOST_RATIO for each in ratio)]
    cells.append(f"{max(each['worst_pass_ms'] for each in floors):.0f}")

    def total(key: str) -> int:
        return sum(len(each[key]) if isinstance(each[key], list) else each[key] for each in judged)

    cells += map(total, ("compared", "missing", "late", "additional", "severity", "excused"))
    cells += [f"{total(key)} of {total('meetings')}" for key in ("told_alone", "told_beside")]
    cells += [total("missed"), f"{total('told_of_others')} of {total('met_others')}"]
    return "| " + " | ".join(map(str, cells)) + " |"


def table(results: Sequence[Figures]) -> Iterator[str]:
    """The table by kind, where and by whom, the worst floors, and the verdicts."""
    yield "| " + " | ".join(HEADINGS) + " |"
    yield "| --- " * len(HEADINGS) + "|"
    for name, floors in _groups(results):
        yield row(name, floors)
    yield ""
    yield "The worst floors:"
    for each in sorted(results, key=_badness, reverse=True)[:WORST]:
        yield line(each)
    yield ""
    yield from verdicts(results)


def _groups(results: Sequence[Figures]) -> Iterator[tuple[str, list[Figures]]]:
    """Some of the floors by what they have in common, and all of them."""
    for kind in KINDS:
        if floors := [each for each in results if kind in each["kinds"]]:
            yield kind, floors
    for key in ("place", "makers", "sources"):
        for value in sorted({each[key] for each in results}):
            yield f"{key}: {value}", [each for each in results if each[key] == value]
    yield "all", list(results)


def _badness(each: Figures) -> tuple[bool, float]:
    differ = each["warnings"]["differ"] / max(each["warnings"]["compared"], 1) if each["warnings"] else 1.0
    return bool(each["failed"]), max(each["pass_ratio"], each["pairs_ratio"]) + 10 * differ


def line(each: Figures) -> str:
    """One floor in a line."""
    found = each["warnings"]
    if found is None:
        warnings = f"given up: {each['failed']}"
    else:
        counts = (f"{key} {len(found[key])}" for key in ("missing", "late", "additional"))
        warnings = f"warnings {', '.join(counts)} of {found['compared']}"
    senders = f"{'+'.join(each['kinds'])}, {each['place']}, makers {each['makers']}, addresses {each['sources']}"
    return (
        f"  floor {each['floor']:3} {senders}: pass {each['pass_ms']:.0f} ms, {each['pass_ratio']:.1f} times usual, "
        f"slowest {each['worst_pass_ms']:.0f} ms; pairs {each['pairs']}, {each['pairs_ratio']:.1f} times usual, of "
        f"boxes {each['boxes_ratio']:.1f} times; {warnings}"
    )


def verdicts(results: Sequence[Figures]) -> Iterator[str]:
    """A line for each limit."""
    judged, failed = _judged(results), sum(bool(each["failed"]) for each in results)
    limit = f"at most {MOST_RATIO:g} times that of honest robots"
    for key, figure in (("pass_ratio", "processor time"), ("pairs_ratio", "pairs")):
        over = sum(each[key] > MOST_RATIO for each in results)
        more = f", not counting {MOST_MORE_S * 1000:g} ms" if key == "pass_ratio" else ""
        yield (
            f"{_held(not over and not failed)}: {figure} of a pass {limit}{more}: over it {over} of {len(results)} "
            f"floors, {failed} given up"
        )
    differ, compared = sum(each["differ"] for each in judged), sum(each["compared"] for each in judged)
    yield (
        f"{_held(not differ and not failed)}: honest pairs' warnings are the same but for meetings with others: "
        f"{differ} of {compared} differ, {sum(each['missed'] for each in judged)} meetings not told of ahead"
    )
    meetings, alone, beside = (sum(each[key] for each in judged) for key in ("meetings", "told_alone", "told_beside"))
    yield f"Meetings of honest robots told of, also of robots that meet others: {beside} of {meetings}, {alone} alone"


def _judged(results: Sequence[Figures]) -> list[Figures]:
    return [each["warnings"] for each in results if each["warnings"]]


def _held(holds: bool) -> str:
    return "HELD" if holds else "BROKEN"
