"""Reads a plan of any supported format, and writes it as sections of a site file."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from xml.etree import ElementTree

from deconflict.settings.importers.drawing import DrawnSite, drawn_site
from deconflict.settings.importers.formats.lif.lif_layouts import is_lif, read_lif
from deconflict.settings.importers.formats.metres import read_layout
from deconflict.settings.importers.formats.openrmf.buildings import read_building
from deconflict.settings.importers.formats.openrmf.rmf_graphs import is_graph, read_graph
from deconflict.settings.importers.formats.opentcs.plant_model import read_plant
from deconflict.settings.importers.plan import NO_LEVELS, ImportedPlan, PlanError
from deconflict.settings.importers.toml_values import toml_value
from ingest.settings import Section

WIDTH_M = 1.2
WIDTHS_M = 0.1, 100
"""The range of widths that a person may give."""
FARTHEST_M = 1e8
"""No coordinate on Earth is larger, in metres."""

HEAD = """\
# From {file}. Complete what the plan does not contain:
# - the id of each datum, unless it is the one that your robots send, and its reference points;
# - the outlines: they are squares and bands {width} m wide around points and lanes;
# - the aisles: delete each two-way lane in which two robots can pass each other.
# Then run `deconflict check`.
"""


@dataclass(frozen=True, slots=True)
class ImportedSite:
    """A plan and the sections that it gives."""

    plan: ImportedPlan
    site: DrawnSite
    text: str
    """The sections as TOML."""


def imported_site(path: Path, width_m: float) -> ImportedSite:
    """The plan in `path`. `width_m` is the width of lanes and places, metres. Raises `PlanError`."""
    try:
        plan = read_plan(path)
        _check_places(plan, path)
        site = drawn_site(plan, width_m)
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError) as error:
        if isinstance(error, PlanError):
            raise
        raise PlanError(f"{path}: does not have the structure of its format: {type(error).__name__} {error}") from error
    return ImportedSite(plan, site, toml(site, HEAD.format(file=path.name, width=width_m)))


def read_plan(path: Path) -> ImportedPlan:
    """The plan in a file. XML is openTCS, and LIF has layouts; `levels` is a table in Open-RMF files, else a list."""
    from deconflict.settings.importers.plan_document import read_document  # noqa: PLC0415 - the command line starts without YAML

    document = read_document(path)
    if isinstance(document, ElementTree.Element):
        return read_plant(document)
    if is_lif(document):
        return read_lif(document)
    if "levels" not in document:
        raise PlanError(f"{path}: {NO_LEVELS}")
    if is_graph(document):
        return read_graph(document)
    return read_layout(document) if isinstance(document["levels"], list) else read_building(document)


def _check_places(plan: ImportedPlan, path: Path) -> None:
    """Raises `PlanError` if a coordinate is not a number, or too large to be drawn."""
    for level in plan.levels:
        bends, doors = (lane.bends for lane in level.lanes), (door.ends for door in level.doors)
        spots = chain((node.at for node in level.nodes), *bends, *doors, *level.walls)
        lifts = ((*lift.at, *lift.size_m) for lift in plan.lifts if lift.level == level.name)
        if not all(abs(number) <= FARTHEST_M for number in chain(*spots, *lifts)):
            raise PlanError(f"{path}: level {level.name!r}: a coordinate is no number, or beyond {FARTHEST_M:.0e} m")


def toml(site: DrawnSite, head: str) -> str:
    """The sections as TOML, without keys that have their default."""
    lines = [head, f"name = {toml_value(site.name)}"]
    for heading in ("datums", "resources", "zones", "obstacles"):
        for section in getattr(site, heading):
            lines += section_lines(heading, section)
    return "\n".join(lines) + "\n"


def section_lines(heading: str, section: Section) -> Iterator[str]:
    """One section as TOML, without keys that have their default."""
    yield f"\n[[{heading}]]"
    for key, value in section.model_dump(mode="json", exclude_defaults=True).items():
        yield f"{key} = {toml_value(value)}"
