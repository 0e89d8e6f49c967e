"""Packs what the engine has learned at a site into bytes for a file: numpy's `.npz`, with a digest of each part.

Each part of the engine gives its state as a `Part` and resumes from the same. A part states its form: what its numbers
mean, and what its columns are. A release resumes with the parts whose statement is its own. The others are set aside,
each as a whole and with a reason, and are learned anew.
"""

import hashlib
import json
from collections.abc import Mapping
from io import BytesIO
from typing import Any, Protocol

import numpy as np

FORMAT = 2
HEAD = "head"
TICK = "tick"
"""Not learned: the pass of which the state is. A black box starts there."""
DAMAGE = "damage"
"""In a part of which not everything can be read: why. Such a part states no form."""

Part = dict[str, Any]
"""The learned state of one part of the engine: an array or a JSON value for each name, and the statement of its form
(`learned_form`)."""


class UnreadableError(ValueError):
    """The learned state can't be used; the message says why."""


class NewerFormatError(UnreadableError):
    """A newer release wrote the state."""


class Learner(Protocol):
    """What learns, keeps it in a part, and resumes with it. `resume` changes nothing if it raises `UnreadableError`."""

    def learned(self) -> Part: ...

    def resume(self, part: Part) -> None: ...


def learned_of(learners: Mapping[str, Learner]) -> dict[str, Part]:
    """A copy of what each has learned, by the name of the part."""
    return {name: learner.learned() for name, learner in learners.items()}


def resume_all(learners: Mapping[str, Learner], parts: Mapping[str, Part]) -> dict[str, str]:
    """Let each go on with its part. Returns the parts that are set aside, each with the reason."""
    others = parts.keys() - learners.keys() - {TICK}
    set_aside = {name: str(parts[name].get(DAMAGE, "this release has no such part")) for name in others}
    for name, learner in learners.items():
        try:
            if name not in parts:
                raise UnreadableError("it is missing")
            learner.resume(parts[name])
        except UnreadableError as error:
            set_aside[name] = str(error)
    return set_aside


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
    digests = {name: _digest(json_values[name], _arrays_of(name, arrays)) for name in parts}
    head = {"format": FORMAT, "parts": json_values, "digests": digests}
    arrays[HEAD] = np.frombuffer(json.dumps(head).encode(), np.uint8)
    file = BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


def unpacked(data: bytes) -> dict[str, Part]:
    """The parts that `packed` wrote, in this release or an earlier one; a damaged one says its `DAMAGE`.

    Raises `UnreadableError` if nothing can be read, and `NewerFormatError`.
    """
    try:
        with np.load(BytesIO(data), allow_pickle=False) as file:
            head = json.loads(file[HEAD].tobytes())
            written_in = head["format"]
            parts: dict[str, Part] = {str(name): dict(values) for name, values in head["parts"].items()}
            arrays, broken = _read_arrays(file)
    except Exception as error:  # zipfile and numpy raise many types of error for a foreign file
        reason = f"{type(error).__name__}: {error}"
        raise UnreadableError(f"it is damaged, or not a file of learned state ({reason})") from error
    if not isinstance(written_in, int) or written_in > FORMAT:
        raise NewerFormatError(f"it has format {written_in} and this release reads up to format {FORMAT}")
    digests = head.get("digests", {})
    for name in {*parts, *(name.partition(".")[0] for name in (*arrays, *broken))}:
        parts[name] = _whole(name, parts.get(name, {}), arrays, broken, digests if written_in > 1 else None)
    return parts


def format_of(data: bytes) -> int | None:
    """The format of a file; None if it can't be read."""
    try:
        with np.load(BytesIO(data), allow_pickle=False) as file:
            return int(json.loads(file[HEAD].tobytes())["format"])
    except Exception:  # noqa: BLE001 - zipfile and numpy raise many types of error for a foreign file
        return None


def _read_arrays(file: Any) -> tuple[dict[str, Any], dict[str, str]]:
    """The arrays of a file by name, and of those that can't be read the reasons."""
    arrays: dict[str, Any] = {}
    broken: dict[str, str] = {}
    for name in file.files:
        if name != HEAD:
            try:
                arrays[name] = file[name]
            except Exception as error:  # noqa: BLE001 - zipfile and numpy raise many types of error
                broken[name] = f"{type(error).__name__}: {error}"
    return arrays, broken


def _whole(
    name: str, values: Part, arrays: Mapping[str, Any], broken: Mapping[str, str], digests: Mapping[str, str] | None
) -> Part:
    """A part with its arrays; its damage instead if it is not as it was written. Format 1 has no `digests`."""
    own = _arrays_of(name, arrays)
    for column, reason in _arrays_of(name, broken).items():
        return {DAMAGE: f"{column} can't be read: {reason}"}
    if digests is not None and digests.get(name) != _digest(values, own):
        return {DAMAGE: "it is not as it was written"}
    return values | own


def _arrays_of(part: str, arrays: Mapping[str, Any]) -> dict[str, Any]:
    """The arrays of a part, by the names that they have in it."""
    begin = f"{part}."
    return {name.removeprefix(begin): array for name, array in arrays.items() if name.startswith(begin)}


def _digest(values: Part, arrays: Mapping[str, Any]) -> str:
    """Of everything in a part: whoever takes it knows that nothing in it is missing, changed or from another file."""
    digest = hashlib.sha256(json.dumps(values, sort_keys=True).encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()
