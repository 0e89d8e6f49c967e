"""Packs what the engine has learned at a site into bytes for a file: numpy's `.npz`, with a digest of each part.

Each part of the engine gives its state as a `Part` and resumes from the same. A part states its form: what its numbers
mean, and what its columns are. A release resumes with the parts whose statement is its own. The others are set aside,
each as a whole and with a reason, and are learned anew.
"""

import hashlib
import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from io import BytesIO
from math import inf
from typing import Annotated, Any, Protocol
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

FORMAT = 2
FASTEST = 1
"""The level of compression: decisions wait while the state is packed, once a minute."""
HEAD = "head"
TICK = "tick"
"""Not learned: the pass of which the state is. A black box starts there."""
DAMAGE = "damage"
"""In a part of which not everything can be read: why. Such a part states no form."""

Part = dict[str, Any]
"""The learned state of one part of the engine: an array or a JSON value for each name, and its `FORM`."""

FORM = "form"
"""The name of the statement in each part."""
MOST_S = 1e11
"""Times and durations beyond are damage."""
Seconds = Annotated[float, Field(ge=0.0, le=MOST_S)]
Count = Annotated[int, Field(ge=0, le=10**15)]
MOST_CASES = 1e15
"""Faded counts beyond are damage."""
_FINITE = ConfigDict(allow_inf_nan=False)


class UnreadableError(ValueError):
    """The learned state can't be used; the message says why."""


class NewerFormatError(UnreadableError):
    """A newer release wrote the state."""


@dataclass(frozen=True, slots=True)
class Column:
    """An array of finite float64 numbers."""

    axes: tuple[str | int, ...]
    """The length of each axis: a number, or the name of the list in the part whose items it is for. With "+1" after
    the name there is one more in front, for all of them together."""
    least: float = -inf
    most: float = inf


def count_column(*axes: str | int) -> Column:
    """A column of faded counts."""
    return Column(axes, 0.0, MOST_CASES)


def time_column(*axes: str | int) -> Column:
    """A column of times or durations."""
    return Column(axes, 0.0, MOST_S)


@dataclass(frozen=True, slots=True)
class Form:
    """What a part has. Its `text` is stored with the part. Another text means another form, which is not taken."""

    content: str
    """What the numbers mean: everything on which they depend and the part does not have, such as edges of bins and
    names of enumerations. A release that changes the meaning changes this text."""
    values: Mapping[str, Any]
    """By name, the types of the JSON values. Items of a list that a column refers to occur once."""
    columns: Mapping[str, Column] = field(default_factory=dict)
    _adapters: dict[str, TypeAdapter[Any]] = field(init=False)

    def __post_init__(self) -> None:
        adapters = {name: TypeAdapter(type_, config=_FINITE) for name, type_ in self.values.items()}
        object.__setattr__(self, "_adapters", adapters)

    @property
    def text(self) -> str:
        """The statement."""
        columns = [f"{name} ({', '.join(map(str, column.axes))})" for name, column in self.columns.items()]
        return "; ".join([self.content, ", ".join(self.values), *columns])

    def part(self, state: Part) -> Part:
        """The state with its statement."""
        return {FORM: self.text, **state}

    def checked(self, part: Part) -> Part:
        """The state of a part of this form. Raises `UnreadableError` for any other."""
        self._check_statement(part)
        state: Part = {}
        for name, adapter in self._adapters.items():
            try:
                state[name] = adapter.validate_python(part[name])
            except ValidationError as error:
                raise UnreadableError(f"{name} is not as it is written here: {_first(error)}") from error
        for name, column in self.columns.items():
            state[name] = _numbers(name, part[name], column, [self._length(axis, state) for axis in column.axes])
        return state

    def _check_statement(self, part: Part) -> None:
        if damage := part.get(DAMAGE):
            raise UnreadableError(str(damage))
        if FORM not in part:
            raise UnreadableError("it does not state its form")
        if part[FORM] != self.text:
            raise UnreadableError(f"it is of another form, {str(part[FORM])[:200]!r}")
        if differing := part.keys() ^ {FORM, *self.values, *self.columns}:
            raise UnreadableError(f"it does not have what it states: {', '.join(sorted(differing))}")

    def _length(self, axis: str | int, state: Part) -> int:
        if isinstance(axis, int):
            return axis
        labels = [repr(label) for label in state[axis.removesuffix("+1")]]
        if len(set(labels)) < len(labels):
            raise UnreadableError(f"{axis} has something twice")
        return len(labels) + axis.endswith("+1")


def _first(error: ValidationError) -> str:
    problem = error.errors(include_url=False, include_input=False)[0]
    return f"{'.'.join(map(str, problem['loc']))}: {problem['msg']}"[:200]


def _numbers(name: str, array: object, column: Column, shape: list[int]) -> Any:
    if not isinstance(array, np.ndarray) or array.dtype != np.float64 or array.shape != tuple(shape):
        found = f"{array.dtype} {array.shape}" if isinstance(array, np.ndarray) else type(array).__name__
        raise UnreadableError(f"{name} is {found} instead of float64 {tuple(shape)}")
    if not np.isfinite(array).all() or (array < column.least).any() or (array > column.most).any():
        raise UnreadableError(f"{name} has a number that is not finite, or beyond {column.least:g} to {column.most:g}")
    return np.array(array, order="C")


class Learner(Protocol):
    """What learns, keeps it in a part, and resumes with it. `resume` changes nothing if it raises `UnreadableError`."""

    def learned(self) -> Part: ...

    def resume(self, part: Part) -> None: ...


def learned_of(learners: Mapping[str, Learner]) -> dict[str, Part]:
    """A copy of what each has learned, by the name of the part."""
    return {name: learner.learned() for name, learner in learners.items()}


def resume_all(learners: Mapping[str, Learner], parts: Mapping[str, Part], new: Collection[str] = ()) -> dict[str, str]:
    """Let each go on with its part. Returns the parts that are set aside, each with the reason.

    Parts that are `new` are not missed, since files of earlier releases do not have them.
    """
    others = parts.keys() - learners.keys() - {TICK}
    set_aside = {name: str(parts[name].get(DAMAGE, "this release has no such part")) for name in others}
    for name, learner in learners.items():
        if name in new and name not in parts:
            continue
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
    with ZipFile(file, "w", ZIP_DEFLATED, compresslevel=FASTEST) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w") as entry:
                np.lib.format.write_array(entry, array, allow_pickle=False)
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
