"""Rows of numbers by key, copied from one engine and taken over by another that has the same keys in other rows.

The numbers are measures, probabilities and times, never a row of another table. So a file from elsewhere can change
figures, and nothing else.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deconflict.runtime.learned_state import Part, UnreadableError

Key = tuple[str, ...]
NAMES, KEYS = "names", "keys"
"""Of a part: the texts of all keys, and (n, k) which of them each key has."""


class KeyedTable(NamedTuple):
    """Rows of columns, and the key of each."""

    keys: Sequence[Key]
    rows: Sequence[int]
    columns: Mapping[str, NDArray[Any]]

    def part(self) -> Part:
        """A copy of the rows."""
        names = sorted({name for key in self.keys for name in key})
        number = {name: at for at, name in enumerate(names)}
        keys = np.array([[number[name] for name in key] for key in self.keys], np.int64)
        return {NAMES: names, KEYS: keys, **{name: column[list(self.rows)] for name, column in self.columns.items()}}

    def fill(self, part: Part) -> None:
        """Take over the rows that both have. Changes nothing if it raises `UnreadableError`."""
        row_of = {key: row for row, key in enumerate(keys_of(part))}
        columns = {name: _column(part, name, column, len(row_of)) for name, column in self.columns.items()}
        both = [(row, row_of[key]) for key, row in zip(self.keys, self.rows, strict=True) if key in row_of]
        to, of = np.array(both, np.int64).reshape(-1, 2).T
        for name, column in columns.items():
            self.columns[name][to] = column[of]

    def rows_not_in(self, part: Part) -> list[int]:
        """The rows that a part does not have. Raises `UnreadableError`."""
        known = set(keys_of(part))
        return [row for key, row in zip(self.keys, self.rows, strict=True) if key not in known]


def keys_of(part: Part) -> list[Key]:
    """The keys of the rows of a part. Raises `UnreadableError`."""
    names, keys = part.get(NAMES), part.get(KEYS)
    if not isinstance(names, list) or not isinstance(keys, np.ndarray) or keys.dtype != np.int64:
        raise UnreadableError("it has no keys")
    if len(keys) and (keys.ndim != 2 or keys.min() < 0 or keys.max() >= len(names)):
        raise UnreadableError("it has a key without a name")
    found = [tuple(str(names[at]) for at in key) for key in keys.tolist()]
    if len(set(found)) < len(found):
        raise UnreadableError("it has a key twice")
    return found


def _column(part: Part, name: str, like: NDArray[Any], rows: int) -> NDArray[Any]:
    column = part.get(name)
    if not isinstance(column, np.ndarray) or (column.dtype, column.shape) != (like.dtype, (rows, *like.shape[1:])):
        raise UnreadableError(f"its {name} are of another form")
    return column
