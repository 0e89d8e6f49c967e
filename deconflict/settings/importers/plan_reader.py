"""Reads a plan of any supported format, and writes it as sections of a site file."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from math import inf
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from deconflict.settings.importers.drawing import DrawnSite, drawn_site
from deconflict.settings.importers.formats.metres import read_layout
from deconflict.settings.importers.formats.openrmf import read_building
from deconflict.settings.importers.formats.opentcs import read_plant
from deconflict.settings.importers.plan import ImportedPlan, PlanError
from deconflict.settings.importers.toml_values import toml_value
from ingest.plain_files import MOST_GIVEN_BYTES, read_file
from ingest.settings import Section

WIDTH_M = 1.2
WIDTHS_M = 0.1, 100
"""The range of widths that a person may give."""
FARTHEST_M = 1e8
"""No coordinate on Earth is larger, in metres."""

HEAD = """\
# From {file}. Complete what the plan does not contain:
# - the id of each datum: the UUID that your robots send, and its reference points;
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
    """The plan in a file. XML is openTCS; `levels` is a table in Open-RMF files, and a list in layouts in metres."""
    import yaml  # noqa: PLC0415 - the command line starts without it

    try:
        text = read_file(path, MOST_GIVEN_BYTES).decode("utf-8-sig")
        if text.lstrip().startswith("<"):
            model = ElementTree.fromstring(text)  # noqa: S314 - a file of the site's own; expat bounds expansion
            return read_plant(model)
        document = json.loads(text) if path.suffix == ".json" else yaml.safe_load(text)
    except RecursionError as error:
        raise PlanError(f"{path}: can't be read: it is nested too deeply") from error
    except (OSError, UnicodeDecodeError, ElementTree.ParseError, json.JSONDecodeError, yaml.YAMLError) as error:
        raise PlanError(f"{path}: can't be read: {error}") from error
    if not isinstance(document, dict) or "levels" not in document:
        raise PlanError(f"{path}: has no levels; expected an Open-RMF building file or an openTCS plant model")
    if _size(document, {}) > len(text):
        raise PlanError(f"{path}: can't be read: it names parts of itself again and again (anchors of YAML)")
    return read_building(document) if isinstance(document["levels"], dict) else read_layout(document)


def _size(value: Any, known: dict[int, float]) -> float:
    """Letters and values, each as often as it is named: no more than letters of the file, unless anchors repeat them.

    It is infinite if a value contains itself. Raises `RecursionError`.
    """
    if not isinstance(value, dict | list):
        return max(len(value), 1) if isinstance(value, str) else 1
    if id(value) not in known:
        known[id(value)] = inf
        known[id(value)] = 1 + sum(
            _size(each, known) for each in (value.values() if isinstance(value, dict) else value)
        )
    return known[id(value)]


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
    return "\n".join([head, f"name = {toml_value(site.name)}", *_sections(site)]) + "\n"


def _sections(site: DrawnSite) -> Iterator[str]:
    for heading in ("datums", "resources", "zones", "obstacles"):
        for section in getattr(site, heading):
            yield from section_lines(heading, section)


def section_lines(heading: str, section: Section) -> Iterator[str]:
    """One section as TOML, without keys that have their default."""
    yield f"\n[[{heading}]]"
    for key, value in section.model_dump(mode="json", exclude_defaults=True).items():
        yield f"{key} = {toml_value(value)}"
