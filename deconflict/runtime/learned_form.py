"""The form of a part of learned state: what its numbers mean, its lists, and its columns of numbers."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Annotated, Any

import numpy as np
from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from deconflict.runtime.learned_state import DAMAGE, Part, UnreadableError

FORM = "form"
"""The name of the statement in each part."""
MOST_S = 1e11
"""Times and durations beyond are damage."""
Seconds = Annotated[float, Field(ge=0.0, le=MOST_S)]
Count = Annotated[int, Field(ge=0, le=10**15)]
MOST_CASES = 1e15
"""Faded counts beyond are damage."""
_FINITE = ConfigDict(allow_inf_nan=False)


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
