"""Functions compiled by numba, typed for mypy.

A kernel is compiled for one signature when its module is imported, and kept on disk: beside the source, or where that
can't be written to in the user's cache; with neither it is compiled in each process anew. The copy on disk is dropped
when the kernel's own file changes and no other, so what a kernel calls is in its file (`tests/test_layout.py`).
Arithmetic is IEEE's, in the order written: `fastmath` stays off, so that an answer does not hang on its neighbours.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numpy.typing import DTypeLike, NDArray

_Function = TypeVar("_Function", bound=Callable[..., object])


def inner(function: _Function) -> _Function:
    """What kernels of the same file call; compiled into each of them."""
    return cast(_Function, numba.njit(error_model="numpy")(function))


def kernel(signature: object) -> Callable[[_Function], _Function]:
    """What is called from outside, compiled for the types of `signature` and no others."""

    def compiled(function: _Function) -> _Function:
        try:
            return cast(_Function, numba.njit(signature, cache=True, error_model="numpy")(function))
        except RuntimeError as error:
            if "cannot cache function" not in str(error):
                raise
            return cast(_Function, numba.njit(signature, error_model="numpy")(function))

    return compiled


def ready(column: NDArray[Any], kind: DTypeLike = np.float64) -> NDArray[Any]:
    """An array as kernels take it, copied only where it must be."""
    as_it_is = column.dtype == kind and column.flags.c_contiguous and column.flags.aligned
    return column if as_it_is else np.require(column, kind, ["C", "A"])
