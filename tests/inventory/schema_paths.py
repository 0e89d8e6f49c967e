"""The fields of a JSON Schema as lines, one for each thing that a user can rely on, so that no addition ends a line.

What users read has `path: type` and `path always`. What they write has a line for each type that is accepted, and for
each default, limit, and field that `may be left out`. Both have a line for each value of an enumeration.
"""

import json
from collections.abc import Iterator
from typing import Any

Schema = dict[str, Any]
DEEPEST = 14
LIMITS = ("minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum", "minLength", "maxLength", "pattern", "format")


class SchemaPaths:
    """Walks through one document. References that contain themselves are followed once."""

    def __init__(self, root: Schema, *, written: bool) -> None:
        """`written` is whether users write such documents, or else read them."""
        self._root, self._written = root, written

    def lines(self, schema: Schema, path: str = "", seen: tuple[str, ...] = ()) -> Iterator[str]:
        """The lines of a schema and of all below it. `seen` are the references that lead to it."""
        schema, seen = self._resolved(schema, seen)
        if not schema or len(seen) > DEEPEST:
            return
        for variant in self._variants(schema):
            yield from self.lines(variant, path + self._mark(variant), seen)
        for value in (*schema.get("enum", ()), *([schema["const"]] if "const" in schema else ())):
            yield f"{path} = {json.dumps(value)}"
        for name, inner in schema.get("properties", {}).items():
            below = f"{path}.{name}".lstrip(".")
            yield from self._field_lines(below, inner, name in schema.get("required", ()), seen)
            yield from self.lines(inner, below, seen)
        for inner in (schema.get("items"), *schema.get("prefixItems", ())):
            if isinstance(inner, dict):
                yield from self.lines(inner, f"{path}[]", seen)
        if isinstance(schema.get("additionalProperties"), dict):
            yield from self.lines(schema["additionalProperties"], f"{path}{{}}", seen)

    def _field_lines(self, path: str, schema: Schema, is_required: bool, seen: tuple[str, ...]) -> Iterator[str]:
        types = self.types(schema, seen)
        if not self._written:
            yield f"{path}: {' or '.join(types)}"
            if is_required:
                yield f"{path} always"
            return
        yield from (f"{path}: {name}" for name in types)
        if not is_required:
            yield f"{path} may be left out"
        resolved = {**self._resolved(schema, seen)[0], **schema}
        yield from (f"{path}: {limit} {json.dumps(resolved[limit])}" for limit in LIMITS if limit in resolved)
        if "default" in schema and not isinstance(schema["default"], dict):
            yield f"{path}: default {json.dumps(schema['default'])}"

    def types(self, schema: Schema, seen: tuple[str, ...] = ()) -> list[str]:
        """The JSON types that a schema allows."""
        schema, seen = self._resolved(schema, seen)
        if variants := self._variants(schema):
            return list(dict.fromkeys(name for variant in variants for name in self.types(variant, seen)))
        kind = schema.get("type", "value" if "const" in schema or "enum" in schema else "any")
        if kind == "array" and isinstance(inner := schema.get("items"), dict):
            return [f"array of {name}" for name in self.types(inner, seen)]
        return list(map(str, kind)) if isinstance(kind, list) else [str(kind)]

    def _variants(self, schema: Schema) -> list[Schema]:
        return [*schema.get("anyOf", ()), *schema.get("oneOf", ()), *schema.get("allOf", ())]

    def _mark(self, variant: Schema) -> str:
        """`(conflict)` for a variant that a constant `kind` or the like tells from the others."""
        properties = self._resolved(variant, ())[0].get("properties", {})
        constants = [inner["const"] for inner in properties.values() if isinstance(inner.get("const"), str)]
        return f"({constants[0]})" if constants else ""

    def _resolved(self, schema: Schema, seen: tuple[str, ...]) -> tuple[Schema, tuple[str, ...]]:
        while "$ref" in schema:
            reference = schema["$ref"]
            if reference in seen:
                return {}, seen
            seen = (*seen, reference)
            schema = self._root
            for part in reference.removeprefix("#/").split("/"):
                schema = schema[part]
        return schema, seen
