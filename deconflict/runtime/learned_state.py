"""Packs what the engine has learned at a site into bytes for a file: numpy's `.npz`, with a CRC for each array.

Each part of the engine gives its state as arrays and JSON values, and resumes from the same. `UnreadableError` is
raised for a file of another release, a damaged file, and any other file.
"""

import json
from collections.abc import Iterable, Mapping
from io import BytesIO
from typing import Any

import numpy as np

from ingest.batch import Floats

FORMAT = 1
HEAD = "head"

Part = dict[str, Any]
"""The learned state of one part of the engine: an array or a JSON value for each name."""


class UnreadableError(ValueError):
    """The learned state can't be read; the message says why."""


def packed(parts: Mapping[str, Part]) -> bytes:
    """The parts as the bytes of one file."""
    arrays: dict[str, Any] = {}
    json_values: dict[str, Part] = {name: {} for name in parts}
    for part, state in parts.items():
        for name, value in state.items():
            if isinstance(value, np.ndarray):
                arrays[f"{part}.{name}"] = value
            else:
                json_values[part][name] = value
    arrays[HEAD] = np.frombuffer(json.dumps({"format": FORMAT, "parts": json_values}).encode(), np.uint8)
    file = BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


def unpacked(data: bytes) -> dict[str, Part]:
    """The parts that `packed` wrote. Raises `UnreadableError`."""
    try:
        with np.load(BytesIO(data), allow_pickle=False) as file:
            head = json.loads(file[HEAD].tobytes())
            parts: dict[str, Part] = {str(name): dict(values) for name, values in head["parts"].items()}
            for name in file.files:
                if name != HEAD:
                    part, _, key = name.partition(".")
                    parts[part][key] = file[name]
    except Exception as error:  # zipfile and numpy raise many types of error for a foreign file
        reason = f"{type(error).__name__}: {error}"
        raise UnreadableError(f"it is damaged, or not a file of learned state ({reason})") from error
    if head.get("format") != FORMAT:
        raise UnreadableError(f"it has format {head.get('format')} and this release reads format {FORMAT}")
    return parts


def numbers(part: Part, name: str, shape: Iterable[int | None]) -> Floats:
    """The array `name` of a part. `shape` is the expected shape; a None in it allows any length.

    Raises `UnreadableError` if the array is missing, has another shape or has a number that is not finite.
    """
    shape = tuple(shape)
    try:
        array = np.asarray(part[name], np.float64)
    except (KeyError, TypeError, ValueError) as error:
        raise UnreadableError(f"{name} is not an array of numbers: {error}") from error
    fits = array.ndim == len(shape) and all(
        expected in (None, length) for expected, length in zip(shape, array.shape, strict=True)
    )
    if not fits or not np.isfinite(array).all():
        raise UnreadableError(f"{name} is not an array of {shape} finite numbers")
    return array
