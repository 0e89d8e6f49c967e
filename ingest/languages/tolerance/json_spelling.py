"""JSON as some programs print it, in the spelling of the standard. Takes time linear in its length."""

import re

from ingest.languages.rules import MOST_LETTERS, MOST_ODDITIES, Findings
from ingest.languages.tolerance.value_reader import LEFT_OUT

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
