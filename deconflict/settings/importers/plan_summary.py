"""What an import found in a plan, what it drew, and what it left out, in sentences for the person who imports."""

from collections import Counter
from collections.abc import Iterable, Iterator

import shapely

from deconflict.settings.importers.drawing import DrawnSite
from deconflict.settings.importers.plan import ImportedPlan
from deconflict_client.counted_nouns import count_of
from ingest.settings import Datum


def summary_lines(plan: ImportedPlan, site: DrawnSite) -> Iterator[str]:
    """The floors with their places by kind and their extent, then what was left out and why, and what is doubtful."""
    yield f"{plan.name}: {plan.format} with {count_of(len(site.datums), 'floor')}"
    for datum in site.datums:
        yield f"  {datum.name}: {_places(datum, site)}"
    for left in site.left_out:
        yield f"  left out: {left.parts}: {left.reason}"
    for doubt in plan.doubts:
        yield f"  look at: {doubt}"


def _places(datum: Datum, site: DrawnSite) -> str:
    outlined = list(site.drawn_on(datum.id))
    if not outlined:
        return "no places"
    kinds = Counter(kind for kind, _, _ in outlined)
    west, south, east, north = shapely.total_bounds([shapely.Polygon(outline) for _, _, outline in outlined])
    return f"{_counted(kinds.items())}; x {west:.1f} to {east:.1f} m, y {south:.1f} to {north:.1f} m"


def _counted(kinds: Iterable[tuple[str, int]]) -> str:
    return ", ".join(count_of(count, "parking place" if kind == "parking" else kind) for kind, count in kinds)
