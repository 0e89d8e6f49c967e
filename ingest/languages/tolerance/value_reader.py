"""The rule by which all languages read a value that is not as the standard says.

A value whose meaning is plain is read. Any other costs itself: not the object in which it stands, as far as the object
means something without it, and not the message. Each is counted, and named by its path.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from operator import is_
from typing import Any

from ingest.languages.rules import MOST_ODDITIES, Findings
from ingest.languages.tolerance.nesting import moved
from ingest.languages.tolerance.spelling import folded, nearest
from ingest.languages.tolerance.value_kinds import TIME_KEYS, UNKNOWN, KeyKind, Kind, ObjectKind, Words

MOST_ITEMS = 20_000
"""Items of a list that are read."""
LARGEST = 1e300
"""Numbers beyond it are looked at more closely."""
LEFT_OUT = "left out"
_X_Y = frozenset(("x", "y"))
UNREADABLE: Any = object()
"""Stands for a value that is left out."""
TRUTHS = {"true": True, "1": True, "yes": True, "false": False, "0": False, "no": False}


@dataclass(slots=True)
class ValueReader:
    """Reads the values of one message, and notes what deviates."""

    findings: Findings
    key_aliases: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """From other names of keys, folded, to those in the schema, of which an object has one."""
    word_aliases: Mapping[str, str] = field(default_factory=dict)
    """From words of no enumeration to those that are meant, both folded."""
    needed: frozenset[str] = frozenset()
    """Keys of which a likeness is noticed if they are absent."""
    counter: str = ""
    """A key that counts the objects of a list by twos. One without it has the number of its place."""
    keeps_others: bool = False
    """Whether to keep keys that the standard does not have, and what can't be read but must not be missing."""
    most_items: int = MOST_ITEMS

    def read(self, sent: dict[str, Any], kind: ObjectKind, path: str = "") -> tuple[dict[str, Any], bool]:
        """The object with values of the right types, and whether it has all that it can't do without."""
        read: dict[str, Any] = {}
        if not kind.names.issuperset(sent):
            sent = self._renested(self._respelt(sent, kind, path), kind, path)
        lacks = kind.required.difference(sent)
        for key, value in sent.items():
            known = kind.keys.get(key)
            if known is None:
                self._other(key, value, path, read)
                continue
            got = value if _is_proper(value, known) else self._value(value, known, _under(path, key))
            if got is not UNREADABLE:
                read[key] = got
            elif known.is_required:
                lacks |= {key}
                if self.keeps_others and value is not None:
                    read[key] = value
        return read, not lacks

    def _other(self, key: str, value: Any, path: str, read: dict[str, Any]) -> None:
        """A key that is not read. It may be kept, with null for numbers that are not finite."""
        finite = _finite(value)
        if finite is not value and not self.keeps_others:
            self.findings.note("value-unreadable", _under(path, key), value, LEFT_OUT)
        if self.keeps_others:
            read[key] = finite

    def _respelt(self, sent: dict[str, Any], kind: ObjectKind, path: str) -> dict[str, Any]:
        """The object with the schema's spelling of keys that are absent under it."""
        respelt = {key: value for key, value in sent.items() if key in kind.keys}
        likenesses = MOST_ODDITIES if self.needed - sent.keys() else 0
        for key, value in sent.items():
            if key in kind.keys:
                continue
            meant = kind.meant(folded(key), self.key_aliases)
            if meant and meant not in respelt and _may_be(value, kind.keys[meant]):
                respelt[meant] = value
                self.findings.note("key-spelling", _under(path, key), value, f"read as {meant}", meant)
                continue
            respelt[key] = value
            if likenesses:
                likenesses -= 1
                self._note_likeness(key, sent, kind, path)
        return respelt

    def _renested(self, sent: dict[str, Any], kind: ObjectKind, path: str) -> dict[str, Any]:
        """The object with values that stand too deep or too flat where the schema has them."""
        for key, value, keys_sent, is_too_deep in moved(sent, kind, self.needed, self.key_aliases):
            sent = {name: each for name, each in sent.items() if name not in keys_sent}
            sent |= value if is_too_deep else {key: value}
            for name in sorted(value if is_too_deep else keys_sent):
                where = _under(path, f"{key}.{name}" if is_too_deep else name)
                reading = _under(path, name if is_too_deep else f"{key}.{name}")
                self.findings.note("nested-otherwise", where, value.get(name), f"read as {reading}")
        return sent

    def _note_likeness(self, key: str, sent: dict[str, Any], kind: ObjectKind, path: str) -> None:
        """Note a key that may be meant for one which is needed and absent."""
        meant = nearest(key, kind.names)
        if meant in self.needed and sent.get(meant) is None:
            self.findings.note("key-unknown", _under(path, key), sent[key], "not used", meant)

    def _value(self, value: Any, known: KeyKind, path: str) -> Any:
        if value is None:
            self.findings.note("null-value", path, None, LEFT_OUT)
            return UNREADABLE
        if known.is_list:
            return self._list(value, known, path)
        return self._item(value, known, path)

    def _list(self, value: Any, known: KeyKind, path: str) -> Any:
        if isinstance(value, dict) and all(map(str.isdecimal, value)):  # a list of programs that count its places
            self.findings.note("single-not-list", path, value, "a list of its values" if value else "an empty list")
            value = [value[place] for place in sorted(value, key=lambda place: (len(place), place))]
        elif isinstance(value, list) and len(value) == 1 and isinstance(value[0], list) and not _is_place(value[0]):
            self.findings.note("single-not-list", path, value, "its only item")
            value = value[0]
        if not isinstance(value, list):
            item = self._item(value, known, path) if value != "" else self._left_out(value, path)
            if item is UNREADABLE:
                return UNREADABLE
            self.findings.note("single-not-list", path, value, "a list of one")
            return self._counted([item])
        items = []
        for row, sent in enumerate(value[: self.most_items]):
            where = f"{path}[{row}]"
            if sent is None:
                self.findings.note("null-value", where, None, LEFT_OUT)
            elif (item := self._item(sent, known, where)) is not UNREADABLE:
                items.append(item)
        return self._counted(items)

    def _counted(self, items: list[Any]) -> list[Any]:
        """The items with numbers for those that have none but stand between others."""
        if not (self.counter and items and isinstance(items[0], dict) and self.counter in items[0]):
            return items
        numbers = [item[self.counter] for item in items]
        first = next((row for row, number in enumerate(numbers) if number is not None), 0)
        before = (numbers[first] or 0) - 2 * (first + 1)
        for item in items:
            before = item[self.counter] = before + 2 if item[self.counter] is None else item[self.counter]
        return items

    def _item(self, value: Any, known: KeyKind, path: str) -> Any:
        kind = known.kind
        if isinstance(value, list) and len(value) == 1 and kind is not object:
            self.findings.note("single-not-list", path, value, "its only item")
            value = value[0]
        if isinstance(kind, ObjectKind):
            if kind.required == _X_Y and path.endswith("]") and _is_place(value):
                self.findings.note("single-not-list", path, value, "x and y")
                value = dict(zip(("x", "y"), value, strict=False))
            if not isinstance(value, dict):
                return self._left_out(value, path, kind)
            read, fits = self.read(value, kind, path)
            if not fits and kind.required.difference(read) == {self.counter}:
                read[self.counter], fits = None, True
                self.findings.note("key-absent", _under(path, self.counter), None, "by its place")
            return read if fits else self._left_out(value, path, kind)
        if isinstance(kind, Words):
            return self._word(value, kind, path)
        if kind is object:
            return value
        return self._scalar(value, known, path)

    def _left_out(self, value: Any, path: str, kind: Kind | None = None) -> Any:
        is_point = isinstance(kind, ObjectKind) and kind.is_timed and path.endswith("]")
        self.findings.note("point-unreadable" if is_point else "value-unreadable", path, value, LEFT_OUT)
        return UNREADABLE

    def _scalar(self, value: Any, known: KeyKind, path: str) -> Any:
        kind = known.kind
        if kind is str:
            return self._text(value, path, is_time=known.is_time)
        read = _truth(value) if kind is bool else _number(value)
        if kind is int and read is not None:
            read = int(read) if float(read).is_integer() else None
        if read is None:
            return self._left_out(value, path)
        if type(read) is not type(value) and not (kind is float and type(value) is int):
            self.findings.note("number-as-text", path, value, f"{read}".lower())
        return read

    def _text(self, value: Any, path: str, *, is_time: bool) -> Any:
        if isinstance(value, str):
            return value
        text = f"{value}".lower() if isinstance(value, bool) else digits(value) if is_number(value) else None
        if text is None:
            return self._left_out(value, path)
        if not is_time:
            self.findings.note("text-as-number", path, value, f'"{text}"')
        elif path not in TIME_KEYS:  # `stamp_of` notes the message's own
            self.findings.note("stamp-epoch", path, value, "since 1970")
        return text

    def _word(self, value: Any, words: Words, path: str) -> Any:
        text = value if isinstance(value, str) else digits(value) if is_number(value) else f"{value}"
        if not text.strip():
            return self._left_out(value, path)
        plain = folded(text)
        meant = words.by_folded.get(plain) or words.by_folded.get(self.word_aliases.get(plain, ""))
        if meant is None:
            self.findings.note("word-unknown", path, value, "by what the robot does")
            return UNKNOWN
        if meant != value:
            self.findings.note("word-spelling", path, value, meant)
        return meant


def _is_proper(value: Any, known: KeyKind) -> bool:
    """Whether a value that is no list and no object is as it should be. It may be for others too."""
    kind, found = known.kind, type(value)
    if known.is_list:
        return False
    if kind is float:
        return (found is float or found is int) and -LARGEST < value < LARGEST
    return found is kind or (isinstance(kind, Words) and found is str and value in kind.terms)


def _may_be(value: Any, known: KeyKind) -> bool:
    """Whether a value under another name may be what is meant: a text is no object."""
    return isinstance(value, dict | list) or not isinstance(known.kind, ObjectKind)


def _is_place(value: Any) -> bool:
    """Whether a value has the x and y of a place, as a list without their keys. A third number may follow."""
    return isinstance(value, list) and 2 <= len(value) <= 3 and all(map(is_number, value))


def _under(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key


def is_number(value: Any) -> bool:
    """Whether a JSON value is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and _is_finite(value)


def digits(value: float) -> str:
    """A finite number as text, without a fraction if it is whole."""
    return str(int(value)) if isinstance(value, int) or value.is_integer() else repr(value)


def number_of(text: str) -> float | None:
    """The finite number that a text spells, also with a decimal comma. None if it spells none."""
    spelt = text.replace(",", ".") if text.count(",") == 1 and "." not in text else text
    try:
        number = float(spelt)
    except ValueError:
        return None
    return number if isfinite(number) and "_" not in text else None


def _number(value: Any) -> float | None:
    if isinstance(value, str):
        return number_of(value)
    return value if is_number(value) else None


def _truth(value: Any) -> bool | None:
    if isinstance(value, bool):
        return value
    return TRUTHS.get(value.strip().lower() if isinstance(value, str) else digits(value) if is_number(value) else "")


def _is_finite(value: float) -> bool:
    try:
        return isfinite(value)
    except OverflowError:
        return False


def _finite(value: Any) -> Any:
    """A JSON value with null for each number that is not finite. The value itself if all are."""
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, dict):
        of_keys = {key: _finite(each) for key, each in value.items()}
        return value if all(of_keys[key] is each for key, each in value.items()) else of_keys
    if isinstance(value, list):
        items = list(map(_finite, value))
        return value if all(map(is_, items, value)) else items
    return value
