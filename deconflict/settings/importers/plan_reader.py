"""A file of any kind that is known, as the TOML of a site file."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import yaml

from deconflict.settings.importers.drawing import DrawnSite, drawn_site
from deconflict.settings.importers.metres import read_layout
from deconflict.settings.importers.openrmf import read_building
from deconflict.settings.importers.opentcs import read_plant
from deconflict.settings.importers.plan import Plan, PlanError
from ingest.settings import Section

WIDTH_M = 1.2

HEAD = """\
# From {file}. Set right what the plan could not say:
# - the id of each datum: the UUID that your robots send, and its reference points;
# - the outlines, which are squares and bands {width} m wide around points and lanes;
# - which two-way lanes are aisles that two robots can't pass each other in; delete the others.
# `deconflict check` tells whether it holds.
"""


def imported_toml(path: Path, width_m: float) -> str:
    """The plan in `path` as TOML. Raises `PlanError`."""
    try:
        plan = read_plan(path)
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, PlanError):
            raise
        raise PlanError(f"{path}: does not have the form of its kind: {type(error).__name__} {error}") from error
    return toml(drawn_site(plan, width_m), HEAD.format(file=path.name, width=width_m))


def read_plan(path: Path) -> Plan:
    """Told apart by the content: XML is openTCS; `levels` that are a table are Open-RMF, that are a list, metres."""
    try:
        text = path.read_text(encoding="utf-8")
        if text.lstrip().startswith("<"):
            model = ElementTree.fromstring(text)  # noqa: S314 - a file of the site's own; expat bounds expansion
            return read_plant(model)
        told = json.loads(text) if path.suffix == ".json" else yaml.safe_load(text)
    except (OSError, UnicodeDecodeError, ElementTree.ParseError, json.JSONDecodeError, yaml.YAMLError) as error:
        raise PlanError(f"{path}: can't be read: {error}") from error
    if not isinstance(told, dict) or "levels" not in told:
        raise PlanError(f"{path}: has no levels; expected an Open-RMF building file or an openTCS plant model")
    return read_building(told) if isinstance(told["levels"], dict) else read_layout(told)


def toml(one: DrawnSite, head: str) -> str:
    """The sections as text, keys with their default left out."""
    return "\n".join([head, f"name = {_value(one.name)}", *_sections(one)]) + "\n"


def _sections(one: DrawnSite) -> Iterator[str]:
    for heading, sections in (("datums", one.datums), ("resources", one.resources), ("zones", one.zones)):
        for section in sections:
            yield from section_lines(heading, section)


def section_lines(heading: str, section: Section) -> Iterator[str]:
    """One section as TOML, keys with their default left out."""
    yield f"\n[[{heading}]]"
    for key, value in section.model_dump(mode="json", exclude_defaults=True).items():
        yield f"{key} = {_value(value)}"


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(one) for one in value) + "]"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
