"""The keys that the code reads, from the types into which it reads messages."""

from collections.abc import Iterator
from typing import Any

import msgspec

from ingest.languages import timestamps
from metrics.conformance.sample_messages import TIMES

Path = tuple[str | int, ...]
"""Keys and positions in lists from the top of a message."""
Schema = dict[str, Any]
MOST_LEVELS = 8
VALUES: Schema = {"number": 1.0, "integer": 1, "string": "a", "boolean": True}
"""By type, a value of a key that no sample has."""


class MessageSchema:
    """The keys of one kind of message."""

    def __init__(self, model: Any) -> None:
        """`model` is a type of msgspec or pydantic."""
        if hasattr(model, "model_json_schema"):
            self._root: Schema = model.model_json_schema()
        else:
            self._root = msgspec.json.schema(model, schema_hook=lambda _: {"description": "anything"})
        self._definitions = self._root.get("$defs", {})

    def paths(self) -> list[Path]:
        """Each key once; of a list that of an item."""
        return [*dict.fromkeys(self._paths(self._root, 0))]

    def whole(self, at_s: float) -> Any:
        """A message that has every key, with values of the right types and no meaning."""
        return self._value(self._root, at_s, 0)

    def _paths(self, schema: Schema, level: int) -> Iterator[Path]:
        for part in self._parts(schema, level):
            if isinstance(items := part.get("items"), dict):
                yield from ((0, *path) for path in self._paths(items, level + 1))
            for key, inner in part.get("properties", {}).items():
                yield (key,)
                yield from ((key, *path) for path in self._paths(inner, level + 1))

    def _parts(self, schema: Schema, level: int) -> Iterator[Schema]:
        """The schemas that a schema refers to or is one of, and itself."""
        if level > MOST_LEVELS:
            return
        yield schema
        if name := schema.get("$ref"):
            yield from self._parts(self._definitions[name.rpartition("/")[2]], level + 1)
        for one_of in (*schema.get("anyOf", ()), *schema.get("oneOf", ()), *schema.get("allOf", ())):
            yield from self._parts(one_of, level + 1)

    def _value(self, schema: Schema, at_s: float, level: int) -> Any:
        for part in self._parts(schema, level):
            if isinstance(items := part.get("items"), dict):
                return [self._value(items, at_s, level + 1)]
            if properties := part.get("properties"):
                return {
                    key: timestamps.write(at_s) if key in TIMES else self._value(inner, at_s, level + 1)
                    for key, inner in properties.items()
                }
            if terms := [term for term in part.get("enum", ()) if term is not None]:
                return terms[0]
            if (kind := part.get("type")) in VALUES:
                return VALUES[kind]
        return 1.0


def keys_of(value: Any) -> Iterator[Path]:
    """The keys of a message; of a list those of its first item."""
    if isinstance(value, list):
        value = {0: value[0]} if value else {}
    for key, inner in value.items() if isinstance(value, dict) else ():
        if isinstance(key, str):
            yield (key,)
        yield from ((key, *path) for path in keys_of(inner))
