"""What a site has taught the engine, as bytes for a file: numpy's `.npz`, each array checked by its CRC when read.

Each part of the engine says what it has learned as arrays and as what JSON can say, and takes the same up again. What
it reads was written by another release, or damaged, or is no such file: then `UnreadableError` says so.
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
"""By name: an array, or what JSON can say."""


class UnreadableError(ValueError):
    """What was learned can't be read; the message says why."""


def packed(parts: Mapping[str, Part]) -> bytes:
    """The parts as one file."""
    arrays: dict[str, Any] = {}
    words: dict[str, Part] = {name: {} for name in parts}
    for part, said in parts.items():
        for name, value in said.items():
            if isinstance(value, np.ndarray):
                arrays[f"{part}.{name}"] = value
            else:
                words[part][name] = value
    arrays[HEAD] = np.frombuffer(json.dumps({"format": FORMAT, "parts": words}).encode(), np.uint8)
    file = BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


def unpacked(data: bytes) -> dict[str, Part]:
    """The parts that `packed` wrote. Raises `UnreadableError`."""
    try:
        with np.load(BytesIO(data), allow_pickle=False) as file:
            head = json.loads(file[HEAD].tobytes())
            parts: dict[str, Part] = {str(name): dict(said) for name, said in head["parts"].items()}
            for name in file.files:
                if name != HEAD:
                    part, _, key = name.partition(".")
                    parts[part][key] = file[name]
    except Exception as error:  # whatever a foreign file makes zipfile and numpy do
        raise UnreadableError(f"it is damaged, or is no file of learning ({type(error).__name__}: {error})") from error
    if head.get("format") != FORMAT:
        raise UnreadableError(f"it has format {head.get('format')} and this release reads format {FORMAT}")
    return parts


def numbers(part: Part, name: str, shape: Iterable[int | None]) -> Floats:
    """The array `name` of a part, of that shape (None where any length will do). Raises `UnreadableError`."""
    shape = tuple(shape)
    try:
        found = np.asarray(part[name], np.float64)
    except (KeyError, TypeError, ValueError) as error:
        raise UnreadableError(f"{name} is not told: {error}") from error
    fits = found.ndim == len(shape) and all(
        wanted in (None, length) for wanted, length in zip(shape, found.shape, strict=True)
    )
    if not fits or not np.isfinite(found).all():
        raise UnreadableError(f"{name} is no array of {shape} finite numbers")
    return found
