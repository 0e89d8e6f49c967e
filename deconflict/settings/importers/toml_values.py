"""Values as TOML writes them."""

import json
import re
from typing import Any

UNESCAPED = re.compile("[\x7f-\x9f\ud800-\udfff]")
"""Characters that JSON leaves as they are and TOML refuses, or that terminals obey."""


def toml_value(value: Any) -> str:
    """A table is written on one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    return UNESCAPED.sub(_escape, json.dumps(value, ensure_ascii=False))


def _escape(found: re.Match[str]) -> str:
    """Half of a pair of surrogates is no character: it becomes the sign for an unknown one."""
    code = ord(found[0])
    return f"\\u{code:04x}" if code < 0xD800 else "\ufffd"
