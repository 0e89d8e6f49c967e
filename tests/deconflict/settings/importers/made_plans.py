"""Small sites, as the tools that know them write them."""

from collections.abc import Sequence
from typing import Any

BUILDING = """
coordinate_system: reference_image
name: works
levels:
  Upper:
    elevation: 4.0
    lanes: []
    measurements:
      - [0, 1, {distance: [3, 5.0]}]
    vertices:
      - [0, 0, 0, "", {lift_cabin: [1, "Lift A"]}]
      - [100, 0, 0, ""]
  Ground:
    elevation: 0
    doors:
      - [4, 5, {name: [1, gate], type: [1, hinged]}]
    walls:
      - [0, 1, {texture_name: [1, default]}]
      - [1, 1, {}]
    lanes:
      - [0, 1, {bidirectional: [4, true], graph_idx: [2, 0]}]
      - [1, 2, {bidirectional: [4, false], graph_idx: [2, 0]}]
      - [1, 3, {bidirectional: [4, true], graph_idx: [2, 0]}]
    measurements:
      - [0, 1, {distance: [3, 10.0]}]
      - [4, 5, {distance: [3, 2.0]}]
    vertices:
      - [100, 200, 0, tug_charger, {is_charger: [4, true], is_parking_spot: [4, true], dock_name: [1, d]}]
      - [300, 200, 0, ""]
      - [300, 400, 0, pantry, {pickup_dispenser: [1, coke]}]
      - [300, 180, 0, bay, {is_parking_spot: [4, true]}]
      - [400, 100, 0, ""]
      - [400, 140, 0, ""]
lifts:
  Lift A:
    {depth: 3.0, width: 2.0, x: 500, y: 100, yaw: 0, reference_floor_name: Ground,
     level_doors: {Ground: [d], Upper: [d]}}
"""

PLANT = """<?xml version="1.0" encoding="UTF-8"?>
<model version="6.0.0" name="hall">
  <point name="P1" {x}="0" {y}="0" type="HALT_POSITION"/>
  <point name="P2" {x}="8000" {y}="0" type="HALT_POSITION"/>
  <point name="P3" {x}="8000" {y}="6000" type="PARK_POSITION"/>
  <point name="P4" {x}="0" {y}="6000" type="HALT_POSITION"/>
  <path name="P1 --- P2" sourcePoint="P1" destinationPoint="P2" maxVelocity="1000" maxReverseVelocity="0"/>
  <path name="P2 --- P1" sourcePoint="P2" destinationPoint="P1" maxVelocity="1000" maxReverseVelocity="0"/>
  <path name="P2 --- P3" sourcePoint="P2" destinationPoint="P3" maxVelocity="1000" maxReverseVelocity="500"/>
  <path name="P3 --- P4" sourcePoint="P3" destinationPoint="P4" maxVelocity="1000" maxReverseVelocity="0"/>
  <locationType name="Pole"><allowedOperation name="CHARGE"/></locationType>
  <locationType name="Transfer station"><allowedOperation name="Load cargo"/></locationType>
  <location name="Pole 1" type="Pole"><link point="P1"/></location>
  <location name="Goods in" type="Transfer station"><link point="P4"/></location>
  <block name="B1" type="SINGLE_VEHICLE_ONLY"><member name="P3 --- P4"/><member name="P2"/></block>
  <block name="B2" type="SAME_DIRECTION_ONLY"><member name="P1 --- P2"/></block>
</model>
"""


def lif_node(name: str, x: float, y: float, map_id: str = "hall", *actions: str) -> dict[str, Any]:
    of_type = {"vehicleTypeId": "tug", "actions": [{"actionType": each, "blockingType": "HARD"} for each in actions]}
    position = {"x": x, "y": y}
    return {"nodeId": name, "mapId": map_id, "nodePosition": position, "vehicleTypeNodeProperties": [of_type]}


def lif_edge(start: str, end: str, **of_type: object) -> dict[str, Any]:
    row = {"vehicleTypeId": "tug", "rotationAllowed": False, **of_type}
    return {"edgeId": f"{start}-{end}", "startNodeId": start, "endNodeId": end, "vehicleTypeEdgeProperties": [row]}


def lif_curve(*points: tuple[float, float]) -> dict[str, Any]:
    """A Bézier curve of the third degree."""
    return {
        "degree": 3,
        "knotVector": [0, 0, 0, 0, 1, 1, 1, 1],
        "controlPoints": [{"x": x, "y": y} for x, y in points],
    }


def lif_file(*layouts: dict[str, Any], version: str = "1.0.0") -> dict[str, Any]:
    meta = {"projectIdentification": "works", "creator": "a test", "lifVersion": version}
    return {"metaInformation": meta, "layouts": list(layouts)}


def lif_layout(
    name: str, level: str, nodes: list[Any], edges: list[Any], stations: Sequence[Any] = ()
) -> dict[str, Any]:
    return {"layoutId": name, "layoutLevelId": level, "nodes": nodes, "edges": edges, "stations": list(stations)}


BEND, BEND_BACK = lif_curve((20, 0), (26, 0), (30, 4), (30, 10)), lif_curve((30, 10), (30, 4), (26, 0), (20, 0))
LIF = lif_file(
    lif_layout(
        "upper",
        "2",
        [lif_node("U1", 30, 10, "upper"), lif_node("U2", 45, 10, "upper", "park")],
        [lif_edge("U1", "U2"), lif_edge("U2", "U1"), lif_edge("U1", "C")],
    ),
    lif_layout(
        "hall-west",
        "1",
        [
            lif_node("A", 0, 0, "hall", "startCharging", "stopCharging"),
            lif_node("B", 20, 0),
            lif_node("D", 20, -12, "hall", "pick", "drop"),
        ],
        [
            lif_edge("A", "B", maxSpeed=1.2),
            lif_edge("B", "A"),
            lif_edge("B", "D"),
            lif_edge("B", "C", trajectory=BEND),
        ],
        [
            {"stationId": "s1", "stationName": "Charger 1", "interactionNodeIds": ["A"]},
            {"stationId": "s2", "stationName": "Press", "interactionNodeIds": ["D"], "stationHeight": "0.55"},
            {"stationId": "s3", "stationName": "Press top", "interactionNodeIds": ["D"], "stationHeight": 1.2},
        ],
    ),
    lif_layout(
        "hall-east",
        "1",
        [lif_node("C", 30, 10), lif_node("E", 42, 10)],
        [lif_edge("C", "B", trajectory=BEND_BACK), lif_edge("C", "E"), lif_edge("C", "U1"), lif_edge("C", "gone")],
        [
            {"stationId": "s4", "stationName": "Wrapper", "interactionNodeIds": ["E"]},
            {"stationId": "s5", "interactionNodeIds": ["gone"], "stationPosition": {"x": 36, "y": 14}},
            {"stationId": "s6", "interactionNodeIds": ["gone"]},
        ],
    ),
)
"""Two levels, the lower one in two layouts: a straight and a bent two-way lane, two one-way lanes, and a lift."""
