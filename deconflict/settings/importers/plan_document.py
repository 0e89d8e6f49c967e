"""Reads the file of a plan, and says what the file is if it is evidently another thing."""

import json
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from math import inf
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import yaml

from deconflict.settings.importers.plan import NO_LEVELS, PlanError
from ingest.plain_files import MOST_GIVEN_BYTES, read_file

PLANT = "model"
"""The outermost element of an openTCS plant model."""
TRAFFIC_EDITOR = "import the NAME.building.yaml that it was made from"
SITE_EDITOR = "is a site of Open-RMF's site editor; export its navigation graphs there, and import these"
XML_KINDS = {
    "svg": "is a drawing (SVG), which has no lanes; import the plan that it was drawn from",
    "tcsOrderSet": "is a set of transport orders of openTCS; import the plant model",
    "tcsResponseSet": "has answers of openTCS to transport orders; import the plant model",
    "tcsStatusMessageSet": "has status messages of openTCS; import the plant model",
}
"""What XML with another outermost element is."""
TOML_LINE = re.compile(r"\s*(\[\[?[\w.\"-]+\]\]?|[\w.\"-]+\s*=\s*\S)")
"""A table or a key with a value."""


class UniqueKeys(yaml.SafeLoader):  # type: ignore[misc]
    """Loads YAML, and refuses a key that a mapping has twice: the first value would be lost."""

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        if twice := _twice(key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            raise PlanError(f"line {node.start_mark.line + 1}: has the key {twice!r} twice; delete one")
        return dict(super().construct_mapping(node, deep=deep))


def read_document(path: Path) -> ElementTree.Element | Any:
    """The outermost element of XML, or else what the JSON or YAML holds. Raises `PlanError`."""
    try:
        text = read_file(path, MOST_GIVEN_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise PlanError(f"{path}: is no text; give the file of the plan, not a picture or an archive of it") from error
    except OSError as error:
        raise PlanError(f"{path}: can't be read: {error}") from error
    try:
        document = _parsed(text, is_json=path.suffix in {".json", ".geojson", ".lif"})
    except PlanError as error:
        raise PlanError(f"{path}: {error}") from error
    except RecursionError as error:
        raise PlanError(f"{path}: can't be read: it is nested too deeply") from error
    except (ElementTree.ParseError, json.JSONDecodeError, yaml.YAMLError) as error:
        unread = f"can't be read: {' '.join(str(error).split())}"
        raise PlanError(f"{path}: {_other_text(path, text) or unread}") from error
    if isinstance(document, str) and (other := _other_text(path, text)):
        raise PlanError(f"{path}: {other}")
    if other := _other_thing(document):
        raise PlanError(f"{path}: {other}")
    return document


def _parsed(text: str, *, is_json: bool) -> ElementTree.Element | Any:
    if text.lstrip().startswith("<"):
        return ElementTree.fromstring(text)  # noqa: S314 - a file of the site's own; expat bounds expansion
    if is_json:
        return json.loads(text, object_pairs_hook=_unique)
    document = yaml.load(text, Loader=UniqueKeys)  # noqa: S506 - a SafeLoader
    if _size(document, {}) > len(text):
        raise PlanError("can't be read: it names parts of itself again and again (anchors of YAML)")
    return document


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


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if twice := _twice(key for key, _ in pairs):
        raise PlanError(f"has the key {twice!r} twice in one object; delete one")
    return dict(pairs)


def _twice(keys: Iterable[str]) -> str | None:
    return next((key for key, count in Counter(keys).items() if count > 1 and key != "<<"), None)


def _other_text(path: Path, text: str) -> str | None:
    """What a text is that is neither XML nor JSON nor YAML."""
    if path.suffix == ".ron":
        return SITE_EDITOR
    first = next((line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")), "")
    return "is TOML, as a site file, not a plan" if TOML_LINE.match(first) else None


def _other_thing(document: Any) -> str | None:
    """What a document is that is evidently no plan, and what to do."""
    if isinstance(document, ElementTree.Element):
        name = document.tag.rpartition("}")[2]
        other = f"is XML, but no openTCS plant model, whose outermost element is <model>; found <{name}>"
        return None if name == PLANT else XML_KINDS.get(name, other)
    if not isinstance(document, Mapping):
        return NO_LEVELS
    if document.get("type") == "FeatureCollection":
        return f"is GeoJSON; {TRAFFIC_EDITOR}"
    if "format_version" in document and "anchors" in document:
        return SITE_EDITOR
    if {"image", "resolution", "origin"} <= document.keys():
        return "is the map of one robot, which has no lanes or places; import a plan"
    return None
