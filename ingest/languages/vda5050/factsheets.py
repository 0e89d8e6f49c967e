"""Factsheets: who a robot is, how large, and how it can drive."""

from ingest.languages.geometry.outlines import Outline, outline_of
from ingest.languages.model import MAX_SPEED_MPS, MAX_TEXT, Identity
from ingest.languages.rules import Findings
from ingest.languages.timestamps import Stamp
from ingest.languages.tolerance.tolerant_json import time_of
from ingest.languages.vda5050.vda_memory import Abilities
from ingest.languages.vda5050.vda_messages import FactsheetMessage, PhysicalParameters, TypeSpecification
from ingest.settings import MOST_BODY_M
from ingest.sizes.stated_bodies import Figure

MOST_LOAD_SETS = 20
_NO_TYPE, _NO_PARAMETERS = TypeSpecification(), PhysicalParameters()


def identity_of(
    uuid: str, manufacturer: str, serial: str, message: FactsheetMessage, stamp: Stamp, findings: Findings
) -> Identity:
    """The identity by a factsheet, without a size if it has none that a robot can have."""
    parameters, kind = message.physical_parameters or _NO_PARAMETERS, message.type_specification or _NO_TYPE
    height_m = parameters.maximum_height if parameters.maximum_height is not None else parameters.height_max
    (length_m, width_m, offset_m, outline, _), figures = _body(message, parameters, findings)
    if not (length_m > 0 and width_m > 0):
        sides = f"{length_m:g} x {width_m:g}"
        findings.note("envelope-not-positive", "physicalParameters", sides, "the default envelope")
        length_m, width_m, offset_m, outline = 0.0, 0.0, (0.0, 0.0), None
    max_speed_mps = abilities_of(message).max_speed_mps
    if max_speed_mps is None and (sent_mps := _speed_mps(parameters)) is not None:
        key = "speedMax" if parameters.maximum_speed is None else "maximumSpeed"
        findings.note("speed-limit-not-positive", f"physicalParameters.{key}", sent_mps, "left out")
    return Identity(
        uuid=uuid,
        stamp_s=time_of(stamp),
        manufacturer=manufacturer[:MAX_TEXT],
        model=(kind.series_name or "")[:MAX_TEXT],
        serial=serial[:MAX_TEXT],
        envelope_m=(length_m, width_m, max(height_m or 0.0, 0.0)),
        offset_m=offset_m,
        outline=outline,
        figures=(*figures, *_load_figures(message.load_specification)),
        max_speed_mps=max_speed_mps,
        findings=tuple(findings),
        oddities=tuple(findings.oddities),
    )


def abilities_of(message: FactsheetMessage) -> Abilities:
    parameters, kind = message.physical_parameters or _NO_PARAMETERS, message.type_specification or _NO_TYPE
    speed_mps = _speed_mps(parameters)
    turn_radps = parameters.maximum_angular_speed
    kinematics = kind.mobile_robot_kinematics or kind.agv_kinematic or ""
    return Abilities(
        speed_mps if speed_mps is not None and 0.0 < speed_mps <= MAX_SPEED_MPS else None,
        turn_radps if turn_radps is not None and turn_radps > 0.0 else None,
        kinematics.upper().startswith("OMNI"),
    )


def _speed_mps(parameters: PhysicalParameters) -> float | None:
    return parameters.maximum_speed if parameters.maximum_speed is not None else parameters.speed_max


def _body(
    message: FactsheetMessage, parameters: PhysicalParameters, findings: Findings
) -> tuple[Outline, tuple[Figure, ...]]:
    """The robot's outline, else the length and width that are stated; and the stated ones beside an outline.

    Several outlines may be for loads and for protective fields. The robot's own is the one nearest to its stated size.
    """
    geometry = message.mobile_robot_geometry or message.agv_geometry
    bodies: list[Outline] = []
    for sent in (geometry.envelopes2d if geometry else None) or ():
        points = sent.vertices or sent.polygon_points or []
        if len(points) < 3:
            findings["outline-unreadable"] = None
        else:
            bodies.append(outline_of([(point.x, point.y) for point in points]))
    length_m, width_m = parameters.length or 0.0, parameters.width or 0.0
    if not bodies:
        return Outline(length_m, width_m), ()
    own = min(bodies, key=lambda body: body.differs_m(length_m, width_m))
    if own.is_simplified:
        findings["outline-not-usable"] = None
    return own, (Figure(length_m, width_m, "physicalParameters", "own"),)


def _load_figures(specification: object) -> list[Figure]:
    """The sizes of loads for which the robot is made, as far as they can be read."""
    sets = specification.get("loadSets") if isinstance(specification, dict) else None
    sizes = [each.get("loadDimensions") for each in (sets if isinstance(sets, list) else ()) if isinstance(each, dict)]
    return [
        Figure(_side(size.get("length")), _side(size.get("width")), "loadSpecification")
        for size in sizes[:MOST_LOAD_SETS]
        if isinstance(size, dict)
    ]


def _side(value: object) -> float:
    return float(value) if isinstance(value, int | float) and 0.0 < value <= MOST_BODY_M else 0.0
