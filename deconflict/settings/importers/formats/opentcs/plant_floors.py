"""The floors of an openTCS plant model, which has no floors of its own.

In this order, what tells them: the map of each point for VDA 5050, groups of layers, and heights.
"""

from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from xml.etree.ElementTree import Element

from deconflict.settings.importers.formats.directed_ways import Floor
from deconflict.settings.importers.plan import PlanError

MAP = "vda5050:mapId"
"""The property that names the map of a point, or of the points where a vehicle drives."""
STOREY_MM = 1500.0
"""Points with a gap of height between them are on two floors."""
ONLY_FLOOR = "0"


class PlantFloors:
    """Which floor each point is on, and what the floors are."""

    def __init__(self, model: Element) -> None:
        self._points = {point.attrib["name"]: point for point in model.findall("point")}
        self._layers = {layer.get("id", ""): layer for layer in model.iter("layer")}
        self._groups = {group.get("id", ""): group.get("name", "") for group in model.iter("layerGroup")}
        maps = self._maps(model)
        groups = {} if maps else self._by_group()
        self.floor_of = maps or groups or self._by_height()
        """The key of each point's floor."""
        self.floors = {key: Floor(name, key if maps else "") for key, name in self._names(bool(maps)).items()}
        """By key, from the lowest."""
        self._sign = "" if maps else "groups of layers" if groups else "heights" if len(self.floors) > 1 else ""
        self._are_maps_given = bool(maps)

    def doubts(self) -> Iterator[str]:
        """What a person should look at, where no map of a point tells its floor."""
        if self._sign:
            yield f"{self._sign} tell the floors, for points have no {MAP}; compare them with the building"
        layers = {self._layer(point) for point in self._points.values()}
        if not self._are_maps_given and not self._sign and len(layers) > 1:
            yield f"{len(layers)} layers are one floor, for their points have neither {MAP} nor heights that differ"

    def _maps(self, model: Element) -> dict[str, str]:
        """The map of each point; empty if none is given.

        A point without one is in that of all vehicles, or else in that of the other points of its layer.
        """
        written: dict[str, str] = {}
        given = {name: found for name, point in self._points.items() if (found := _map_of(point, written))}
        usual = {found for vehicle in model.findall("vehicle") if (found := _map_of(vehicle, written))}
        if not given and len(usual) != 1:
            return {}
        by_layer: dict[str, set[str]] = {}
        for name, found in given.items():
            by_layer.setdefault(self._layer(self._points[name]), set()).add(found)
        maps = {}
        for name, point in self._points.items():
            near = usual if len(usual) == 1 else by_layer.get(self._layer(point)) or set(given.values())
            if name not in given and len(near) > 1:
                raise PlanError(
                    f"point {name!r} has no property {MAP}, and the points of its layer have several "
                    f"({', '.join(sorted(near))}); set it in the model editor"
                )
            maps[name] = given.get(name) or next(iter(near))
        return maps

    def _by_group(self) -> dict[str, str]:
        """The group of each point's layer; empty if there is only one."""
        found = {name: self._group(point) for name, point in self._points.items()}
        return found if len(set(found.values())) > 1 else {}

    def _by_height(self) -> dict[str, str]:
        heights = sorted({_height_mm(point) for point in self._points.values()})
        floor_of, row = {heights[0]: ONLY_FLOOR}, 0
        for below, above in pairwise(heights):
            row += above - below > STOREY_MM
            floor_of[above] = str(row)
        return {name: floor_of[_height_mm(point)] for name, point in self._points.items()}

    def _names(self, are_maps: bool) -> dict[str, str]:
        """The name of each floor, from the lowest: that of its group of layers if it is the only floor of the group."""
        heights: dict[str, list[tuple[float, int]]] = {}
        groups: dict[str, set[str]] = {}
        for name, key in self.floor_of.items():
            point = self._points[name]
            heights.setdefault(key, []).append((_height_mm(point), self._ordinal(point)))
            groups.setdefault(key, set()).add(self._group(point))
        owners = Counter(group for found in groups.values() for group in found)
        names = {key: key for key in sorted(heights, key=lambda key: min(heights[key]))}
        for key, found in groups.items():
            group = next(iter(found))
            if len(groups) > 1 and len(found) == owners[group] == 1 and self._groups.get(group):
                names[key] = self._groups[group]
        if len(names) == 1 and not are_maps:
            return dict.fromkeys(names, ONLY_FLOOR)
        given = Counter(names.values())
        return {key: name if given[name] == 1 else f"{name} {key}" for key, name in names.items()}

    def _layer(self, point: Element) -> str:
        layout = point.find("pointLayout")
        return "" if layout is None else layout.get("layerId", "")

    def _group(self, point: Element) -> str:
        layer = self._layers.get(self._layer(point))
        return "" if layer is None else layer.get("groupId", "")

    def _ordinal(self, point: Element) -> int:
        layer = self._layers.get(self._layer(point))
        return 0 if layer is None else int(layer.get("ordinal", "0"))


def _map_of(element: Element, written: dict[str, str]) -> str:
    """The map as it was first written: ids of maps differ in more than case."""
    found = next((each.get("value", "") for each in element.findall("property") if each.get("name") == MAP), "")
    return written.setdefault(found.casefold(), found)


def _height_mm(point: Element) -> float:
    return float(point.get("positionZ") or point.get("zPosition") or 0.0)
