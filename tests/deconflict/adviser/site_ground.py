"""Site files with ground onto which robots are sent, or not."""

from typing import Any

from deconflict.settings.site import Site
from tests.deconflict.adviser.floors import LOWER, UPPER, Point

Section = dict[str, Any]
DATUMS = [{"id": LOWER, "name": "Lower hall"}, {"id": UPPER, "name": "Upper hall"}]


def box(west_m: float, south_m: float, east_m: float, north_m: float) -> list[Point]:
    return [(west_m, south_m), (east_m, south_m), (east_m, north_m), (west_m, north_m)]


def area(outline_m: list[Point], floor: str = LOWER, *, keep_clear: bool = True) -> Section:
    return {"areas": [{"name": "Fire door", "keep_clear": keep_clear, "floor": floor, "outline_m": outline_m}]}


def obstacle(outline_m: list[Point]) -> Section:
    return {"obstacles": [{"kind": "machine", "floor": LOWER, "outline_m": outline_m}]}


def resource(kind: str, outline_m: list[Point]) -> Section:
    return {"resources": [{"id": "r", "kind": kind, "datum": LOWER, "polygon": outline_m}]}


def landing(outline_m: list[Point]) -> Section:
    lift = {"id": "r", "kind": "lift", "datum": UPPER, "polygon": box(90.0, 90.0, 92.0, 92.0)}
    return {"resources": [lift | {"floors": [{"datum": LOWER, "polygon": outline_m}]}]}


def zone(kind: str, outline_m: list[Point]) -> Section:
    axis = {"axis": [outline_m[0], outline_m[2]]} if kind == "aisle" else {}
    return {"zones": [{"id": "z", "kind": kind, "datum": LOWER, "polygon": outline_m, **axis}]}


def site_of(*sections: Section, **keys: Any) -> Site:
    joined: Section = {}
    for section in sections:
        for key, entries in section.items():
            joined.setdefault(key, []).extend(entries)
    return Site.model_validate({"datums": DATUMS, **joined, **keys})


REFUGE = {"areas": [{"name": "Wide aisle", "refuge": True, "floor": LOWER, "outline_m": box(-9.0, -9.0, 9.0, 9.0)}]}
