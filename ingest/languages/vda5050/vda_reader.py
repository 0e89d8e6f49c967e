"""From the bytes of a message of VDA 5050 to a model of it, with the deviations of its keys, types and header."""

from functools import cache
from typing import Any, cast

import msgspec

from ingest.languages import timestamps
from ingest.languages.rules import Findings, RejectedError
from ingest.languages.vda5050.vda_messages import KINDS, REQUIRED, Header

MOST_LEFT_OUT = 5
"""Unreadable optional keys of one message that are left out. A message with more is rejected."""
_READABLE = ("2.", "3.")
"""Versions begin with one of these."""


def decoded(kind: str, raw: bytes, findings: Findings) -> Header:
    """The message of a topic that ends in `kind`. Raises `RejectedError` if it can't be understood."""
    try:
        message = cast(Header, _decoder(kind).decode(raw))
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        message = _repaired(kind, raw, findings)
    for key in REQUIRED[kind]:
        if getattr(message, key) is None:
            findings["key-absent"] = None
            break
    if message.version and not message.version.startswith(_READABLE):
        findings["version-unknown"] = None
    return message


def stamp_of(message: Header, findings: Findings) -> timestamps.Stamp:
    """The message's own time. Raises `RejectedError` if it can't be read or lies outside 1970 to 2100."""
    text = message.timestamp or ""
    stamp = timestamps.parse(text)
    if stamp is None:
        raise RejectedError("stamp-unreadable", f"timestamp {text[:60]!r} is no ISO 8601 date-time in UTC")
    if not timestamps.plausible(stamp.t_s):
        raise RejectedError("stamp-absurd", f"timestamp {text[:60]!r} lies outside 1970 to 2100")
    findings.update(dict.fromkeys(stamp.findings))
    return stamp


@cache
def _decoder(kind: str) -> msgspec.json.Decoder[Any]:
    return msgspec.json.Decoder(KINDS[kind])


def _repaired(kind: str, raw: bytes, findings: Findings) -> Header:
    """The message with numbers that were sent as text, and without the optional keys that can't be read."""
    document = _parsed(raw)
    for _ in range(MOST_LEFT_OUT + 1):
        try:
            converted = msgspec.convert(document, KINDS[kind], strict=False)
            message = cast(Header, _decoder(kind).decode(msgspec.json.encode(converted)))  # numbers are finite again
        except msgspec.ValidationError as error:
            key = _misfit(str(error))
            if key not in document:
                raise RejectedError("type-wrong", str(error)[:200]) from None
            del document[key]
            findings["value-unreadable"] = None
        else:
            findings.setdefault("value-unreadable" if "value-unreadable" in findings else "number-as-text")
            return message
    raise RejectedError("type-wrong", f"more than {MOST_LEFT_OUT} keys can't be read; send the types of the schema")


def _parsed(raw: bytes) -> dict[str, Any]:
    try:
        document = msgspec.json.decode(raw)
    except UnicodeDecodeError:
        raise RejectedError("not-utf8", "the message is not UTF-8; send JSON text in UTF-8") from None
    except RecursionError:
        raise RejectedError("too-deep", "nested too deep; no message of the standard is") from None
    except msgspec.MsgspecError as error:
        raise RejectedError("not-json", str(error)[:200]) from None
    if not isinstance(document, dict):
        raise RejectedError("not-object", "the message is no JSON object; send one message a publish")
    return document


def _misfit(error: str) -> str:
    """The top-level key in the path of a validation error, as `$.loads[0].weight`. "" if it has none."""
    return error.rpartition("`$.")[2].rstrip("`").partition(".")[0].partition("[")[0] if "`$." in error else ""
