"""The entries of an Open-RMF building file, checked, with y up. Each fault is a sentence that names level and entry."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, nan
from reprlib import repr as shortened
from typing import Any

from deconflict.settings.importers.plan import PlanError, Spot

Properties = Mapping[str, Any]
"""Values by key, without their types."""
FARTHEST = 1e9
"""Coordinates beyond are no place, in pixels, metres or degrees."""


@dataclass(frozen=True, slots=True)
class PlanVertex:
    """A vertex in the unit of its level."""

    at: Spot
    name: str
    properties: Properties


@dataclass(frozen=True, slots=True)
class PlanEdge:
    """A lane, door, wall or measurement between two vertices, by their rows."""

    start: int
    end: int
    properties: Properties


@dataclass(frozen=True, slots=True)
class PlanLevel:
    """A level in the unit of its drawing."""

    name: str
    elevation_m: float
    vertices: tuple[PlanVertex, ...]
    fiducials: Mapping[str, Spot]
    lanes: tuple[PlanEdge, ...]
    doors: tuple[PlanEdge, ...]
    walls: tuple[PlanEdge, ...]
    measurements: tuple[PlanEdge, ...]
    table: Mapping[str, Any]
    """All of it as in the file."""


def plan_levels(document: Mapping[str, Any], y_sign: float) -> dict[str, PlanLevel]:
    """The levels by name, from the lowest. `y_sign` is -1 where y is downwards in the file."""
    tables = mapping(document.get("levels"), "levels")
    levels = [_level(str(name), mapping(table, f"levels.{name}"), y_sign) for name, table in tables.items()]
    if not any(level.vertices for level in levels):
        raise PlanError("levels: have no vertices; draw lanes in the traffic editor")
    return {level.name: level for level in sorted(levels, key=lambda level: level.elevation_m)}


def _level(name: str, table: Mapping[str, Any], y_sign: float) -> PlanLevel:
    where = f"levels.{name}"
    vertices = tuple(_vertex(entry, at, y_sign) for at, entry in entries(table, where, "vertices"))

    def edges(part: str) -> tuple[PlanEdge, ...]:
        return tuple(_edge(entry, at, len(vertices)) for at, entry in entries(table, where, part))

    return PlanLevel(
        name,
        number(table.get("elevation", 0), f"{where}.elevation"),
        vertices,
        _fiducials(table, where, y_sign),
        edges("lanes"),
        edges("doors"),
        edges("walls"),
        edges("measurements"),
        table,
    )


def entries(table: Mapping[str, Any], where: str, part: str) -> Iterator[tuple[str, Sequence[Any]]]:
    """Each entry of a list, after where it is."""
    rows = table.get(part) or ()
    if not isinstance(rows, Sequence) or isinstance(rows, str):
        raise PlanError(f"{where}.{part}: must be a list, not {shortened(rows)}")
    for row, entry in enumerate(rows):
        if not isinstance(entry, Sequence) or isinstance(entry, str):
            raise PlanError(f"{where}.{part}.{row}: must be a list, not {shortened(entry)}")
        yield f"{where}.{part}.{row}", entry


def _spot(entry: Sequence[Any], where: str, y_sign: float) -> Spot:
    if len(entry) < 2:
        raise PlanError(f"{where}: must begin with x and y, not {shortened(entry)}")
    return number(entry[0], f"{where}, x"), number(entry[1], f"{where}, y") * y_sign


def _vertex(entry: Sequence[Any], where: str, y_sign: float) -> PlanVertex:
    name = entry[3] if len(entry) > 3 and entry[3] is not None else ""
    return PlanVertex(_spot(entry, where, y_sign), str(name), _properties(entry[4:], where))


def _fiducials(table: Mapping[str, Any], where: str, y_sign: float) -> dict[str, Spot]:
    found: dict[str, Spot] = {}
    for at, entry in entries(table, where, "fiducials"):
        name = str(entry[2]) if len(entry) > 2 else ""
        if name in found:
            raise PlanError(f"{at}: the level has another fiducial {name!r}; rename or delete one")
        if name:
            found[name] = _spot(entry, at, y_sign)
    return found


def _edge(entry: Sequence[Any], where: str, vertices: int) -> PlanEdge:
    rows = entry[:2]
    if len(rows) < 2 or not all(type(row) is int and 0 <= row < vertices for row in rows):
        raise PlanError(f"{where}: must begin with two vertices from 0 to {vertices - 1}, not {shortened(entry)}")
    return PlanEdge(rows[0], rows[1], _properties(entry[2:], where))


def _properties(rest: Sequence[Any], where: str) -> Properties:
    pairs = mapping(rest[0] or {}, where) if rest else {}
    for key, pair in pairs.items():
        if not isinstance(pair, Sequence) or isinstance(pair, str) or len(pair) != 2:
            raise PlanError(f"{where}: {key} must be [type, value], not {shortened(pair)}")
    return {str(key): pair[1] for key, pair in pairs.items()}


def mapping(found: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(found, Mapping):
        raise PlanError(f"{where}: must be a table, not {shortened(found)}")
    return found


def number(found: Any, where: str) -> float:
    try:
        value = nan if isinstance(found, bool) else float(found)
    except (TypeError, ValueError, OverflowError):
        value = nan
    if not isfinite(value) or abs(value) > FARTHEST:
        raise PlanError(f"{where}: must be a number of at most {FARTHEST:.0e}, not {shortened(found)}")
    return value
