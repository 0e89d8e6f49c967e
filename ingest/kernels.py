"""Functions compiled by numba, typed for mypy.

A kernel is compiled for one signature when its module is imported. The compiled copy is kept on disk: beside the
source, or in the user's cache if that folder can't be written to. With neither it is compiled in each process. numba
drops a copy when the kernel's own file changes. `SourceStamp` makes it drop the copy also when a helper or a constant
of another file changes, so kernels may share both.

On x86-64 a copy fits nearly every processor since 2009, so an image or a folder of copies serves machines that differ.
Kernels for the very processor are no faster. `NUMBA_CPU_NAME` has them compiled for another one.

Arithmetic is IEEE's, in the order written: `fastmath` stays off, so that an answer does not depend on its neighbours.
"""

import hashlib
import importlib
import pickle
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core import event
from numba.core.caching import InTreeCacheLocator, UserProvidedCacheLocator, UserWideCacheLocator
from numba.core.codegen import get_host_cpu_features
from numpy.typing import DTypeLike, NDArray

_Function = TypeVar("_Function", bound=Callable[..., object])
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True}
"""A wrapper for calls from C would take a tenth of the time of compilation, and nothing calls it."""
_FEATURES = {"+cx16", "+popcnt", "+sahf", "+sse4.2"}
"""What a processor needs for LLVM's `x86-64-v2`. numba has to know before the first `njit`."""
_found = get_host_cpu_features().split(",")  # type: ignore[no-untyped-call]
if numba.config.CPU_NAME is None and _FEATURES.issubset(_found):  # type: ignore[attr-defined]
    numba.config.CPU_NAME, numba.config.CPU_FEATURES = "x86-64-v2", ""  # type: ignore[attr-defined]
INT, FLOAT, BOOL = numba.int64, numba.float64, numba.boolean
INTS, FLOATS, BOOLS = INT[::1], FLOAT[::1], BOOL[::1]
MATRIX, CUBE, CUBES = FLOAT[:, ::1], FLOAT[:, :, ::1], FLOAT[:, :, :, ::1]
INT_MATRIX, BOOL_MATRIX = INT[:, ::1], BOOL[:, ::1]
"""Types in signatures: numbers, and arrays to which a kernel may write."""
READ_INTS, READ_FLOATS, READ_BOOLS = (numba.types.Array(kind, 1, "C", readonly=True) for kind in (INT, FLOAT, BOOL))
READ_MATRIX, READ_CUBE = (numba.types.Array(FLOAT, dimensions, "C", readonly=True) for dimensions in (2, 3))
ANY_FLOATS = numba.types.Array(FLOAT, 1, "A", readonly=True)
"""Arrays that a kernel only reads. The last takes each column of a matrix, too."""
_postponed: dict[str, list[Callable[[], object]]] | None = None
"""In a process that calls `compile_module`: by module, a call for each kernel that compiles it."""


def inner(function: _Function) -> _Function:
    """A helper that kernels of any file call; it is compiled into each of them."""
    return cast(_Function, numba.njit(**_OPTIONS)(function))


def named_type(named: type, *fields: object) -> Any:
    """The type of a `NamedTuple` in signatures, with these types of its fields."""
    return numba.types.NamedTuple(fields, named)  # type: ignore[no-untyped-call]


@inner
def copy_row(values: NDArray[Any], into: NDArray[Any]) -> None:
    """Write (k,) values to the same places of `into`, inside a kernel.

    The assignment of an array to a slice does the same, but numba then compiles the texts of its errors, for seconds.
    """
    for at in range(len(values)):
        into[at] = values[at]


@inner
def copy_rows(values: NDArray[Any], into: NDArray[Any]) -> None:
    """As `copy_row`, of (k, n) values."""
    for row in range(values.shape[0]):
        for column in range(values.shape[1]):
            into[row, column] = values[row, column]


def kernel(signature: object, *, for_kernels: bool = False) -> Callable[[_Function], _Function]:
    """A function that Python calls, compiled for the types of `signature` and no others.

    That is `result(argument, ...)`, or only `(argument, ...)` where the function tells the type of its result.
    With `for_kernels` other kernels may call it, too, and are compiled with a copy of it.
    """

    def compiled(function: _Function) -> _Function:
        try:
            if _postponed is not None:
                dispatcher = numba.njit(cache=True, **_OPTIONS)(function)
                _postponed.setdefault(function.__module__, []).append(partial(_compile, dispatcher, signature))
                return cast(_Function, dispatcher)
            dispatcher = numba.njit(signature, cache=True, **_OPTIONS)(function)
            if not for_kernels:
                _drop_copy_for_kernels(dispatcher)
            return cast(_Function, dispatcher)
        except RuntimeError as error:
            if "cannot cache function" not in str(error):
                raise
            return cast(_Function, numba.njit(signature, **_OPTIONS)(function))

    return compiled


def _drop_copy_for_kernels(dispatcher: Any) -> None:
    """Free the second copy of a loaded kernel, which numba keeps to compile the kernel into others: a third of a MB.

    numba has no option for it. If it names the field otherwise one day, this does nothing.
    """
    for compiled in dispatcher.overloads.values():
        compiled.library._shared_module = None


def _compile(dispatcher: Any, signature: object) -> None:
    """Compile for this signature and no others, so that other kernels convert what they call it with."""
    dispatcher.compile(signature)
    dispatcher.disable_compile()


def compile_module(name: str) -> None:
    """Compile the kernels of one module that are not on disk.

    From now on, kernels of other modules that this process imports are compiled only when they are called.
    """
    global _postponed  # noqa: PLW0603 - `kernel` is called while Python imports the module
    _postponed = _postponed or {}
    importlib.import_module(name)
    for compiles in _postponed.pop(name, []):
        compiles()


class _FirstCompilation(event.Listener):
    def __init__(self, prepare: Callable[[], object]) -> None:
        self._prepare: Callable[[], object] | None = prepare

    def on_start(self, _: event.Event) -> None:
        prepare, self._prepare = self._prepare, None
        if prepare:
            prepare()

    def on_end(self, _: event.Event) -> None:
        pass


@contextmanager
def before_compiling(prepare: Callable[[], object]) -> Iterator[None]:
    """Calls `prepare` before the first kernel in this block that is not on disk is compiled."""
    with event.install_listener("numba:compile", _FirstCompilation(prepare)):
        yield


def ready(column: NDArray[Any], kind: DTypeLike = np.float64) -> NDArray[Any]:
    """An array in the form that kernels take. It is copied only if it has another form."""
    as_it_is = column.dtype == kind and column.flags.c_contiguous and column.flags.aligned
    return column if as_it_is else np.require(column, kind, ["C", "A"])


class SourceStamp:
    """Mixed into numba's cache locators: a kernel's stamp covers all that is compiled into it."""

    def __init__(self, function: FunctionType, file: str) -> None:
        super().__init__(function, file)  # type: ignore[call-arg]
        self._function = function

    def get_source_stamp(self) -> tuple[str, ...]:
        """A digest of each source file and constant that the kernel uses, its own file first."""
        return tuple(dict.fromkeys(_digests(self._function, set())))


def _digests(function: FunctionType, seen: set[FunctionType]) -> Iterator[str]:
    seen.add(function)
    yield _file_digest(function.__code__.co_filename)
    for name in sorted(_global_names(function.__code__)):
        value = function.__globals__.get(name)
        helper = getattr(value, "py_func", None)
        if isinstance(helper, FunctionType):
            if helper not in seen:
                yield from _digests(helper, seen)
        elif isinstance(value, type):
            yield _file_digest(sys.modules[value.__module__].__file__ or "")
        elif isinstance(value, int | float | str | tuple | np.ndarray):
            yield hashlib.sha256(name.encode() + pickle.dumps(value)).hexdigest()


def _global_names(code: CodeType) -> set[str]:
    """The names that a function, and those defined in it, may take from its module."""
    nested = (constant for constant in code.co_consts if isinstance(constant, CodeType))
    return set(code.co_names).union(*map(_global_names, nested))


def _file_digest(path: str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


class BesideSource(SourceStamp, InTreeCacheLocator):
    """Keeps compiled copies beside the source."""


class InUserCache(SourceStamp, UserWideCacheLocator):
    """Keeps compiled copies in the user's cache."""


class WhereAsked(SourceStamp, UserProvidedCacheLocator):
    """Keeps compiled copies in the folder of `NUMBA_CACHE_DIR`."""


_CHOICE = ",".join(f"{__name__}.{locator.__name__}" for locator in (WhereAsked, BesideSource, InUserCache))
numba.config.CACHE_LOCATOR_CLASSES = _CHOICE  # type: ignore[attr-defined]
