"""From the bytes of a message to a model of it, as far as its meaning is clear. Languages of brokers share it.

JSON as some programs print it is first put in the spelling of the standard, in time linear in its length.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from types import NoneType, UnionType
from typing import Any, NamedTuple, TypeVar, Union, cast, get_args, get_origin

import msgspec
from pydantic_core import from_json

from ingest.languages import timestamps
from ingest.languages.model import Path
from ingest.languages.rules import MOST_LETTERS, MOST_ODDITIES, Findings, RejectedError
from ingest.languages.tolerance.value_kinds import object_kind
from ingest.languages.tolerance.value_reader import LEFT_OUT, ValueReader

_TOKEN = re.compile(rb"""("[^"\\]*(?:\\.[^"\\]*)*"?)(?=\s*(:)?)|,(?=\s*[\]}])|[^\s",:\[\]{}]+""", re.DOTALL)
"""A text, and whether it is a key; a comma before the end of a list or an object; or a number or a bare word."""
_NOT_FINITE = re.compile(rb"[-+]?(?:nan(?:\(\w*\))?|inf(?:inity)?|1\.\#[a-z]+\d*)", re.IGNORECASE)
"""As C and PLC code print it."""
_NUMBER = re.compile(rb"([-+]?)(\d*)(?:\.(\d*))?((?:[eE][-+]?\d+)?)")
_WORDS = {b"True": b"true", b"False": b"false", b"None": b"null"}
_CONTROLS = bytes(range(32))
_SPACED = bytes.maketrans(_CONTROLS, b" " * len(_CONTROLS))


class JsonSpelling:
    """Spells one message. A number that is not finite becomes NaN; the value reader counts it."""

    def __init__(self) -> None:
        self.findings = Findings()
        """What was spelt otherwise, once for each key before it; at most `MOST_ODDITIES`."""
        self._key, self._named = b"", set[bytes]()
        self._bare: dict[bytes, bytes] = {}
        """By number or bare word as sent, its spelling: a hostile list repeats one."""

    def spelt(self, raw: bytes) -> bytes:
        """The message in the spelling of JSON, as far as its meaning is clear."""
        ended = raw.rstrip(b"\0")
        if ended != raw:
            self._note(b"\0", b"")
        return _TOKEN.sub(self._spelt, ended)

    def _spelt(self, match: re.Match[bytes]) -> bytes:
        token, text = match[0], match[1]
        if text:
            spelt = text.translate(_SPACED)
            if match[2]:
                self._key = text[1:-1][:MOST_LETTERS]
        elif token == b",":
            spelt = b""
        elif token in self._bare:
            spelt = self._bare[token]
        else:
            is_finite = not _NOT_FINITE.fullmatch(token)
            spelt = self._bare[token] = (_WORDS.get(token) or _number(token)) if is_finite else b"NaN"
        if spelt not in (token, b"NaN"):
            self._note(token, spelt)
        return spelt

    def _note(self, token: bytes, spelt: bytes) -> None:
        if self._key in self._named or len(self._named) == MOST_ODDITIES:
            return
        self._named.add(self._key)
        key, value, reading = (part[:MOST_LETTERS].decode(errors="replace") for part in (self._key, token, spelt))
        self.findings.note("json-spelling", key, value, reading or LEFT_OUT)


def _number(token: bytes) -> bytes:
    """A number without a plus, without zeros before it, and with digits on both sides of its point. Else the token."""
    found = _NUMBER.fullmatch(token)
    if not found or not (found[2] or found[3]):
        return token
    sign, whole, fraction, exponent = found.groups()
    after = b"" if fraction is None else b"." + (fraction or b"0")
    return sign.strip(b"+") + (whole.lstrip(b"0") or b"0") + after + exponent


_HALF_LETTER = re.compile(rb"\\u[dD][89a-fA-F][0-9a-fA-F]{2}")
"""One of the two halves by which JSON writes some letters. Senders cut texts between them."""
BYTE_ORDER_MARK = b"\xef\xbb\xbf"
Model = TypeVar("Model", bound=msgspec.Struct)
_JSON_KINDS = {
    list: "array",
    str: "string",
    bool: "true or false",
    int: "number",
    float: "number",
    type(None): "null",
}


class KnownNames(NamedTuple):
    """The names of a language as senders have them."""

    needed: frozenset[str]
    """Keys of which a likeness is noticed if they are absent."""
    words: Mapping[str, str] = {}
    """From words of no enumeration to those that are meant, both folded."""
    counter: str = ""
    """The key that counts the objects of a list by twos."""
    keys: Mapping[str, tuple[str, ...]] = {}
    """From other names of keys, folded, to those in the schema, of which an object has one."""


def decoded(
    model: type[Model],
    raw: bytes,
    findings: Findings,
    lacks_key: Callable[[Any], bool],
    required: Iterable[tuple[str, str]],
    names: KnownNames,
    *,
    is_first: bool,
) -> Model:
    """The message as a model whose keys are all optional. `required` keys are attributes with their spelling.

    A message that lacks a key which it should have is read anew, for the key may be there in another spelling. So is
    one that `is_first`. Raises `RejectedError` if it can't be
    understood.
    """
    if not is_first:
        try:
            message = cast(Model, _decoder(model).decode(raw))
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
            pass
        else:
            if not lacks_key(message):
                return message
    message = _repaired(model, raw, findings, names)
    for key, spelling in required:
        if getattr(message, key) is None:
            findings.note("key-absent", spelling, None, LEFT_OUT)
    return message


def lacks_required(required: Callable[[Any], Any], message: Any) -> bool:
    """Whether a required key is absent."""
    return None in required(message)


def document(raw: bytes) -> dict[str, Any]:
    """A message that was accepted, as it was sent; null stands for numbers that are not finite."""
    try:
        sent = msgspec.json.decode(raw)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        sent = None
    if isinstance(sent, dict):
        return sent
    reader = ValueReader(Findings(), keeps_others=True)
    return reader.read(parsed(raw, Findings()), object_kind(_Anything))[0]


def stamp_of(text: str | None, findings: Findings) -> timestamps.Stamp:
    """The message's own time. `NO_STAMP` if it can't be read or lies outside 1970 to 2100."""
    stamp = timestamps.parse(text or "")
    if stamp is None or not timestamps.plausible(stamp.t_s):
        findings.note("stamp-absurd" if stamp else "stamp-unreadable", "timestamp", text, "as of its arrival")
        return timestamps.NO_STAMP
    for rule in stamp.findings:
        findings.note(rule, "timestamp", text, timestamps.write(stamp.t_s))
    return stamp


def time_of(stamp: timestamps.Stamp, *paths: Path) -> float:
    """The time of a pose. Without a stamp that of the first point of its paths; 0 if it has none."""
    if stamp.is_known:
        return stamp.t_s
    return min((min(path.times) for path in paths if path.poses), default=0.0)


def parsed(raw: bytes, findings: Findings) -> dict[str, Any]:
    """The JSON object of a message, also of a list of one, and as programs spell it. Raises `RejectedError` if none."""
    if raw.startswith(BYTE_ORDER_MARK):
        findings["byte-order-mark"] = None
        raw = raw.removeprefix(BYTE_ORDER_MARK)
    try:
        sent = from_json(raw)
    except ValueError as error:
        sent = _parsed_odd(raw, error, findings)
    if isinstance(sent, list) and len(sent) == 1 and isinstance(sent[0], dict):
        findings.note("single-not-list", "", sent, "its only item")
        sent = sent[0]
    if not isinstance(sent, dict):
        raise RejectedError("not-object", f"JSON {_JSON_KINDS[type(sent)]}; send one JSON object a message")
    return sent


def _parsed_odd(raw: bytes, error: ValueError, findings: Findings) -> Any:
    """The same of a message that is spelt as JSON is not, or has bytes in texts that are no letters.

    Raises `RejectedError` if that is not all.
    """
    spelling = JsonSpelling()
    spelt = spelling.spelt(raw)
    try:
        sent = from_json(spelt)
    except ValueError:
        readable = _HALF_LETTER.sub(rb"\\ufffd", spelt.decode(errors="replace").encode())
        if readable == spelt:
            raise _not_parsed(raw, str(error)) from None
        try:
            sent = from_json(readable)
        except ValueError:
            raise _not_parsed(raw, str(error)) from None
        findings["text-not-utf8"] = None
    findings.update(spelling.findings)
    findings.name(spelling.findings.oddities)
    return sent


class _Anything(msgspec.Struct):
    """An object of which no key is known."""


@cache
def _decoder(model: type[msgspec.Struct]) -> msgspec.json.Decoder[Any]:
    return msgspec.json.Decoder(_null_free(model))


@cache
def _null_free(struct: type[msgspec.Struct]) -> type[msgspec.Struct]:
    """A kind of `struct` whose keys may be absent as before, but not null: such a message is read value by value."""
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
        return _null_free(annotation)
    return annotation


def _repaired(model: type[Model], raw: bytes, findings: Findings, names: KnownNames) -> Model:
    """The message read value by value."""
    reader = ValueReader(findings, names.keys, names.words, names.needed, names.counter)
    read, _ = reader.read(parsed(raw, findings), object_kind(model))
    return msgspec.convert(read, model)


def _not_parsed(raw: bytes, why: str) -> RejectedError:
    try:
        raw.decode()
    except UnicodeDecodeError as broken:
        return RejectedError("not-utf8", f"byte {broken.start} is not UTF-8; send JSON text in UTF-8")
    what, _, place = why.partition(" at ")
    if what.startswith("recursion limit"):
        return RejectedError("too-deep", f"nests deeper than any message of the standard, at {place}")
    what = what.replace("EOF while parsing", "it ends within").replace("expected ident", "expected a value")
    return RejectedError("not-json", f"{what} at {place}; send one JSON object a message")
