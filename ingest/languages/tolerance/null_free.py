"""Structs that decode the same objects, but take no null: a message with null is read value by value, and counted."""

from functools import cache
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin

import msgspec


@cache
def null_free(struct: type[msgspec.Struct]) -> type[msgspec.Struct]:
    """A kind of `struct` whose keys may be absent as before, but not null."""
    fields: list[Any] = []
    for field in msgspec.structs.fields(struct):
        kind = _without_null(field.type)
        fields.append((field.name, kind) if field.required else (field.name, kind, field.default))
    return msgspec.defstruct(struct.__name__, fields, bases=(struct,), frozen=True, gc=False, kw_only=True)


def _without_null(annotation: Any) -> Any:
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin in (Union, UnionType):
        return _without_null(next(each for each in arguments if each is not NoneType))
    if origin is list:
        return list[_without_null(arguments[0])]  # type: ignore[misc]
    if isinstance(annotation, type) and issubclass(annotation, msgspec.Struct):
        return null_free(annotation)
    return annotation
