"""Repairs a report whose types are wrong but whose meaning is clear, by the rule of all languages."""

from typing import Any

from ingest.languages.massrobotics.fast_decoder import struct_of
from ingest.languages.massrobotics.json_objects import Report
from ingest.languages.massrobotics.path_points import MOST_POINTS_USED
from ingest.languages.massrobotics.report_models import IdentityReport
from ingest.languages.rules import Findings
from ingest.languages.tolerance.spelling import folded
from ingest.languages.tolerance.value_kinds import object_kind
from ingest.languages.tolerance.value_reader import ValueReader, is_number

NAMES_OF_THE_TEXT: dict[str, tuple[str, ...]] = {
    "pose": ("location", "angle"),
    "posequaternion": ("angle",),
    "posequaternions": ("angle",),
    "quaternion": ("angle",),
    "qx": ("x",),
    "qy": ("y",),
    "qz": ("z",),
    "qw": ("w",),
    "length": ("x",),
    "width": ("y",),
    "height": ("z",),
    "planardatumid": ("planarDatum",),
    "nextworkinglocation": ("destinations",),
    "nextworkinglocations": ("destinations",),
    "errorcode": ("errorCodes",),
    "estimatedremainingruntime": ("remainingRunTime",),
    "cargocapacityvolumelimit": ("cargoMaxVolume",),
    "cargocapacityweightlimit": ("cargoMaxWeight",),
    "visualthumbnailimage": ("thumbnailImage",),
    "linktoproductdocumentation": ("productDocumentation",),
}
"""Names of keys in the text of the standard or in another one, folded, and those of its schema, of which an object has
one."""
TEXTS = ("timestamp", "operationalState", "manufacturerName", "robotModel", "robotSerialNumber")
"""Required texts without which a report still says the rest."""


def repaired(document: dict[str, Any], model: type[Report], findings: Findings) -> dict[str, Any]:
    """A copy of the report with values of the right types, without those that can't be read.

    What the report can't do without stays as it is if it can't be read.
    """
    reader = ValueReader(findings, NAMES_OF_THE_TEXT, keeps_others=True, most_items=MOST_POINTS_USED)
    read, _ = reader.read(document, object_kind(struct_of(model)))
    for key in TEXTS:
        if key in model.model_fields and not isinstance(read.get(key), str):
            if key not in read:
                findings.note("key-absent", key, None, "read as empty")
            read[key] = ""
    if model is IdentityReport and not _is_size(read.get("baseRobotEnvelope")):
        read["baseRobotEnvelope"] = {"x": 0.0, "y": 0.0}
    return read


def _is_size(envelope: Any) -> bool:
    return isinstance(envelope, dict) and all(is_number(envelope.get(side)) for side in "xy")


def meant_key(key: str, model: type[Report]) -> str:
    """The key that is meant by one which the schema spells otherwise. "" if the schema has none for it."""
    return object_kind(struct_of(model)).meant(folded(key), NAMES_OF_THE_TEXT)
