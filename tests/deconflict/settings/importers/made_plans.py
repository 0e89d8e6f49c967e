"""Small sites, as the tools that know them write them."""

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
