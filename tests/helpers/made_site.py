"""A valid site file, of which tests change one key at a time."""

import json
from copy import deepcopy
from pathlib import Path
from typing import Any

MARKS = {"door": (0.0, 0.0), "dock": (40.0, 1.0), "pillar": (38.0, 25.0), "gate": (2.0, 24.0)}
HALL = "a0eebc99-9c0b-4ef8-bb6d-6bb9bd380a11"

_SOUND: dict[str, Any] = {
    "name": "works",
    "datums": [
        {
            "id": HALL,
            "name": "Hall",
            "reference_points": [{"id": mark, "x": x, "y": y} for mark, (x, y) in MARKS.items()],
        },
        {
            "id": "yard",
            "name": "Yard",
            "coordinates": "latlon",
            "reference_location": [42.36, -71.06],
            "reference_points": [{"id": "post", "x": 42.361, "y": -71.059}],
        },
    ],
    "vendors": [
        {"name": "acme", "robots": ["1c0e7d6e-1111-4f6f-8000-000000000001"]},
        {
            "name": "bolt",
            "manufacturers": ["Bolt Robotics"],
            "models": {"b1": {"offset_m": [1.1, 0.0]}},
            "maps": [
                {
                    "datum": "own",
                    "site_datum": HALL,
                    "readings": {mark: [y, -x] for mark, (x, y) in MARKS.items()},
                }
            ],
        },
    ],
}


def sound() -> dict[str, Any]:
    return deepcopy(_SOUND)


def put(document: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """Set the value at a path such as `vendors.1.name` of a document. None removes it. Returns the document."""
    *parents, last = [int(part) if part.isdigit() else part for part in path.split(".")]
    at: Any = document
    for part in parents:
        at = at.setdefault(part, {}) if isinstance(at, dict) else at[part]
    if value is None:
        del at[last]
    elif isinstance(at, list) and last == len(at):
        at.append(value)
    else:
        at[last] = value
    return document


def written(document: dict[str, Any], folder: Path) -> Path:
    path = folder / "site.toml"
    path.write_text(toml(document), encoding="utf-8")
    return path


def toml(document: dict[str, Any]) -> str:
    """A document as TOML, one line for each of its top-level keys."""
    return "".join(f"{json.dumps(key)} = {_toml(value)}\n" for key, value in document.items())


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return json.dumps(value) if isinstance(value, str) else repr(value)
