"""Open-RMF buildings of the same floors, drawn in any way: in metres, or on drawings that lie and are scaled anyhow."""

import cmath
import json
import random
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

Building = dict[str, Any]

PLACES = [
    [2.0, -3.0, 0, "charger", {"is_charger": [4, True]}],
    [14.0, -3.0, 0, "goods", {"pickup_dispenser": [1, "rack"]}],
    [14.0, -9.0, 0, "", {"lift_cabin": [1, "Lift"]}],
    [20.0, -9.0, 0, ""],
    [20.0, -11.0, 0, ""],
]
PILLARS = {"north": (1.0, -1.0), "east": (25.0, -2.0), "south": (6.0, -16.0)}


def in_metres() -> Building:
    """Three floors with the same places, and a lift that belongs to the middle one."""
    lanes = [[0, 1, {"bidirectional": [4, True]}], [1, 2, {"bidirectional": [4, True]}]]
    level = {"vertices": PLACES, "lanes": lanes, "doors": [[3, 4, {"name": [1, "gate"]}]], "walls": [[0, 4]]}
    lift = {"x": 14.0, "y": -9.0, "yaw": 0.3, "width": 2.0, "depth": 3.0, "reference_floor_name": "Upper"}
    return {
        "name": "works",
        "coordinate_system": "cartesian_meters",
        "reference_level_name": "Ground",
        "levels": {name: deepcopy(level) | {"elevation": row} for row, name in enumerate(("Ground", "Upper", "Roof"))},
        "lifts": {"Lift": lift | {"level_doors": {"Ground": ["d"], "Upper": ["d"], "Roof": ["d"]}}},
    }


def on_drawings(seed: int = 0) -> Building:
    """The same, each floor on a drawing of its own, in pixels with y downwards.

    The drawing of the ground floor is neither turned nor shifted: it is the frame of the building. The other floors
    have no measurements.
    """
    draw = random.Random(seed)
    building = in_metres() | {"coordinate_system": "reference_image"}
    for name, level in building["levels"].items():
        scale, turn, shift = (
            draw.uniform(5, 80),
            draw.uniform(-3, 3),
            complex(draw.uniform(0, 900), draw.uniform(0, 900)),
        )
        factor = complex(scale) if name == "Ground" else cmath.rect(scale, turn)
        paint = _painter(factor, 0j if name == "Ground" else shift)
        level["vertices"] = [[*paint(x, y), *rest] for x, y, *rest in level["vertices"]]
        level["fiducials"] = [[*paint(*at), pillar] for pillar, at in PILLARS.items()]
        if name == "Upper":
            lift = building["lifts"]["Lift"]
            lift["x"], lift["y"] = paint(lift["x"], lift["y"])
            lift["yaw"] += turn
    building["levels"]["Ground"]["measurements"] = [[0, 1, {"distance": [3, 12.0]}]]
    return building


def _painter(factor: complex, shift: complex) -> Callable[[float, float], tuple[float, float]]:
    def paint(x: float, y: float) -> tuple[float, float]:
        pixel = factor * complex(x, y) + shift
        return pixel.real, -pixel.imag

    return paint


def as_graph(building: Building) -> Building:
    """The navigation graph of a building in metres: a lane in each direction, properties without types."""
    levels = {}
    for name, level in building["levels"].items():
        vertices = [[x, y, {"name": label, **_untyped(rest)}] for x, y, _, label, *rest in level["vertices"]]
        lanes = [
            [*ends, {"speed_limit": 0.0}] for start, end, _ in level["lanes"] for ends in ((start, end), (end, start))
        ]
        levels[name] = {"vertices": vertices, "lanes": lanes}
    lift = building["lifts"]["Lift"]
    gates = {f"gate {name}": {"map": name, "endpoints": [[20.0, -9.0], [20.0, -11.0]]} for name in levels}
    shaft = {"position": [lift["x"], lift["y"], lift["yaw"]], "dims": [lift["width"], lift["depth"]]}
    return {"building_name": "works", "levels": levels, "doors": gates, "lifts": {"Lift": shaft}}


def _untyped(rest: list[dict[str, Any]]) -> dict[str, Any]:
    names = {"lift_cabin": "lift"}
    return {names.get(key, key): value for properties in rest for key, (_, value) in properties.items()}


def saved(building: Building, folder: Path) -> Path:
    path = folder / "works.building.json"
    path.write_text(json.dumps(building), encoding="utf-8")
    return path
