"""Factsheets: who a robot is, how large, and how it can drive."""

from ingest.languages.model import Identity
from ingest.languages.outlines import Outline, outline_of
from ingest.languages.rules import Findings, RejectedError
from ingest.languages.timestamps import Stamp
from ingest.languages.vda5050.vda_memory import Abilities
from ingest.languages.vda5050.vda_messages import FactsheetMessage, PhysicalParameters, TypeSpecification

MAX_SIZE_M = 100.0
MAX_TEXT = 100
MAX_SPEED_MPS = 100.0
_NO_TYPE, _NO_PARAMETERS = TypeSpecification(), PhysicalParameters()


def identity_of(
    uuid: str, manufacturer: str, serial: str, message: FactsheetMessage, stamp: Stamp | None, findings: Findings
) -> Identity:
    """The identity by a factsheet. Raises `RejectedError` if it has no size that a robot can have."""
    parameters, kind = message.physical_parameters or _NO_PARAMETERS, message.type_specification or _NO_TYPE
    height_m = parameters.maximum_height if parameters.maximum_height is not None else parameters.height_max
    length_m, width_m, offset_m, outline, _ = _body(message, parameters, findings)
    if not (length_m > 0 and width_m > 0):
        reason = f"physicalParameters say {length_m:g} x {width_m:g} m; send the robot's length and width"
        raise RejectedError("envelope-not-positive", reason)
    if max(length_m, width_m, height_m or 0.0) > MAX_SIZE_M:
        raise RejectedError("envelope-absurd", f"the robot is {length_m:g} x {width_m:g} m; send metres")
    max_speed_mps = abilities_of(message).max_speed_mps
    if max_speed_mps is None and _speed_mps(parameters) is not None:
        findings["speed-limit-not-positive"] = None
    return Identity(
        uuid=uuid,
        stamp_s=stamp.t_s if stamp else 0.0,
        manufacturer=manufacturer[:MAX_TEXT],
        model=(kind.series_name or "")[:MAX_TEXT],
        serial=serial[:MAX_TEXT],
        envelope_m=(length_m, width_m, max(height_m or 0.0, 0.0)),
        offset_m=offset_m,
        outline=outline,
        max_speed_mps=max_speed_mps,
        findings=tuple(findings),
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


def _body(message: FactsheetMessage, parameters: PhysicalParameters, findings: Findings) -> Outline:
    """The robot's outline, else the length and width that are stated.

    Several outlines may be for loads and for protective fields. The robot's own is the one nearest to its stated size.
    """
    geometry = message.mobile_robot_geometry or message.agv_geometry
    bodies: list[Outline] = []
    for sent in (geometry.envelopes2d if geometry else None) or ():
        points = sent.vertices or sent.polygon_points or []
        if len(points) < 3 or any(abs(point.x) > MAX_SIZE_M or abs(point.y) > MAX_SIZE_M for point in points):
            findings["outline-unreadable"] = None
        else:
            bodies.append(outline_of([(point.x, point.y) for point in points]))
    length_m, width_m = parameters.length or 0.0, parameters.width or 0.0
    own = min(bodies, key=lambda body: body.differs_m(length_m, width_m), default=Outline(length_m, width_m))
    if own.is_simplified:
        findings["outline-not-usable"] = None
    return own
