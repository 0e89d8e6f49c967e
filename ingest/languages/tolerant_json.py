"""From the bytes of a message to a model of it, as far as its meaning is clear. Languages of brokers share it."""

from functools import cache
from typing import Any, TypeVar, cast

import msgspec

from ingest.languages import timestamps
from ingest.languages.rules import Findings, RejectedError

MOST_LEFT_OUT = 5
"""Unreadable optional keys of one message that are left out. A message with more is rejected."""
Model = TypeVar("Model", bound=msgspec.Struct)


def decoded(model: type[Model], raw: bytes, findings: Findings) -> Model:
    """The message as a model whose keys are all optional. Raises `RejectedError` if it can't be understood."""
    try:
        return cast(Model, _decoder(model).decode(raw))
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return _repaired(model, raw, findings)


def document(raw: bytes) -> dict[str, Any]:
    """A message that was accepted, as it was sent."""
    sent: dict[str, Any] = msgspec.json.decode(raw)
    return sent


def stamp_of(text: str | None, findings: Findings) -> timestamps.Stamp:
    """The message's own time. Raises `RejectedError` if it can't be read or lies outside 1970 to 2100."""
    stamp = timestamps.parse(text or "")
    if stamp is None:
        raise RejectedError("stamp-unreadable", f"timestamp {(text or '')[:60]!r} is no ISO 8601 date-time in UTC")
    if not timestamps.plausible(stamp.t_s):
        raise RejectedError("stamp-absurd", f"timestamp {(text or '')[:60]!r} lies outside 1970 to 2100")
    findings.update(dict.fromkeys(stamp.findings))
    return stamp


@cache
def _decoder(model: type[msgspec.Struct]) -> msgspec.json.Decoder[Any]:
    return msgspec.json.Decoder(model)


def _repaired(model: type[Model], raw: bytes, findings: Findings) -> Model:
    """The message with numbers that were sent as text, and without the optional keys that can't be read."""
    sent = _parsed(raw)
    for _ in range(MOST_LEFT_OUT + 1):
        try:
            converted = msgspec.convert(sent, model, strict=False)
            message = cast(Model, _decoder(model).decode(msgspec.json.encode(converted)))  # numbers are finite again
        except msgspec.ValidationError as error:
            key = _misfit(str(error))
            if key not in sent:
                raise RejectedError("type-wrong", str(error)[:200]) from None
            del sent[key]
            findings["value-unreadable"] = None
        else:
            findings.setdefault("value-unreadable" if "value-unreadable" in findings else "number-as-text")
            return message
    raise RejectedError("type-wrong", f"more than {MOST_LEFT_OUT} keys can't be read; send the types of the schema")


def _parsed(raw: bytes) -> dict[str, Any]:
    try:
        sent = msgspec.json.decode(raw)
    except UnicodeDecodeError:
        raise RejectedError("not-utf8", "the message is not UTF-8; send JSON text in UTF-8") from None
    except RecursionError:
        raise RejectedError("too-deep", "nested too deep; no message of the standard is") from None
    except msgspec.MsgspecError as error:
        raise RejectedError("not-json", str(error)[:200]) from None
    if not isinstance(sent, dict):
        raise RejectedError("not-object", "the message is no JSON object; send one message a publish")
    return sent


def _misfit(error: str) -> str:
    """The top-level key in the path of a validation error, as `$.loads[0].weight`. "" if it has none."""
    return error.rpartition("`$.")[2].rstrip("`").partition(".")[0].partition("[")[0] if "`$." in error else ""
