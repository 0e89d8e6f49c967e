"""The size of a robot as it states it, by the one rule of size."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Literal, NamedTuple, get_args

from ingest.shapes import Shape
from ingest.sizes.size_limit import (
    ALIKE,
    SAME,
    SIZE_IN_OTHER_UNIT,
    SIZE_OVER_LIMIT,
    UNITS,
    Rectangle,
    are_within,
    converted_text,
    over_limit_text,
    size_text,
)

NARROWEST_M = 0.05
"""No robot is narrower."""
Kind = Literal["own", "same", "alike"]
"""Of figures, the surest first: of the same body in the same message, of a body of the same model, of what is about as
long."""
KINDS = get_args(Kind)


class Figure(NamedTuple):
    """Another length and width that may show in which unit a size is."""

    length_m: float
    width_m: float
    source: str
    """Where it is stated, for people."""
    kind: Kind = "alike"


class StatedBody(NamedTuple):
    """A robot's envelope without load."""

    envelope_m: tuple[float, float, float]
    """Length, width and height; height 0 if unknown."""
    offset_m: tuple[float, float] = (0.0, 0.0)
    """From the reported location to the centre of the envelope."""
    outline: Shape | None = None
    """Around the reported location; None for a rectangle."""

    @property
    def rectangle(self) -> Rectangle:
        return Rectangle.about(self.offset_m, *self.envelope_m[:2])


class BodyReading(NamedTuple):
    """How the size of a robot is read."""

    body: StatedBody
    rules: tuple[str, ...] = ()
    """Codes of the rules from which it deviates."""
    notes: tuple[str, ...] = ()
    """The same for people: what was stated, and what it counts as."""

    @property
    def is_over_limit(self) -> bool:
        return SIZE_OVER_LIMIT in self.rules


def read_body(stated: StatedBody, figures: Sequence[Figure], largest_m: float) -> BodyReading:
    """The size that counts. `figures` are those that may show the unit."""
    if stated.rectangle.is_within(largest_m):
        return _with_height(BodyReading(stated), stated, largest_m)
    usable = [figure for figure in figures if 0.0 < min(figure[:2]) <= max(figure[:2]) <= largest_m]
    usable.sort(key=lambda figure: KINDS.index(figure.kind))
    what = f"a size of {size_text(*stated.envelope_m)}"
    if found := next(_in_other_units(stated, usable, largest_m), None):
        body, unit, why = found
        notes = (converted_text(what, unit, why, largest_m),)
        return _with_height(BodyReading(body, (SIZE_IN_OTHER_UNIT,), notes), stated, largest_m)
    note = over_limit_text(_with_offset(what, stated), largest_m)
    body = _at_limit(stated, largest_m)
    if own := next((figure for figure in usable if figure.kind == "own"), None):
        body = StatedBody((own.length_m, own.width_m, stated.envelope_m[2]))
        note = f"{what} is beyond reading.largest_body_m = {largest_m:g}; {own.source} holds instead. Send metres"
    return _with_height(BodyReading(body, (SIZE_OVER_LIMIT,), (note,)), stated, largest_m)


def _in_other_units(
    stated: StatedBody, figures: Iterable[Figure], largest_m: float
) -> Iterator[tuple[StatedBody, str, str]]:
    """Each body that another unit gives and another figure confirms, with the unit and the source of the figure."""
    for figure in figures:
        for unit, per_m in UNITS:
            body = _scaled(stated, per_m)
            if body.rectangle.is_within(largest_m) and _confirms(figure, body):
                yield body, unit, figure.source
    length, width, height = stated.envelope_m
    if stated.outline is None and not any(stated.offset_m) and min(length, width) <= largest_m:
        for unit, per_m in UNITS:
            sides_m = _metres(length, per_m, largest_m), _metres(width, per_m, largest_m)
            if max(sides_m) <= largest_m and are_within(*sides_m, ALIKE):
                yield StatedBody((*sides_m, height)), unit, "its other side"


def _confirms(figure: Figure, body: StatedBody) -> bool:
    length_m, width_m, _ = body.envelope_m
    if figure.kind == "alike":
        longer_m = max(length_m, width_m)
        return min(length_m, width_m) >= NARROWEST_M and are_within(longer_m, max(figure[:2]), ALIKE)
    return are_within(length_m, figure.length_m, SAME) and are_within(width_m, figure.width_m, SAME)


def _metres(side: float, per_m: float, largest_m: float) -> float:
    return side / per_m if side > largest_m else side


def _scaled(stated: StatedBody, per_m: float) -> StatedBody:
    length, width, height = (side / per_m for side in stated.envelope_m)
    x, y = (side / per_m for side in stated.offset_m)
    return StatedBody((length, width, height), (x, y), stated.outline.divided(per_m) if stated.outline else None)


def _at_limit(stated: StatedBody, largest_m: float) -> StatedBody:
    back_m, front_m, right_m, left_m = stated.rectangle.bounded(largest_m)
    envelope_m = front_m - back_m, left_m - right_m, stated.envelope_m[2]
    return StatedBody(envelope_m, ((back_m + front_m) / 2, (right_m + left_m) / 2))


def _with_height(reading: BodyReading, stated: StatedBody, largest_m: float) -> BodyReading:
    """The reading with a height that a body of these sides can have."""
    height, (length_m, width_m, read_m) = stated.envelope_m[2], reading.body.envelope_m
    highest_m = largest_m if reading.is_over_limit else min(ALIKE * max(length_m, width_m), largest_m)
    if height <= largest_m:  # of a body in another unit it may be in metres
        height_m = height if height <= highest_m or not reading.rules else read_m
        return _of_height(reading, height_m)
    what = f"a height of {height:g}"
    possible = [(height / per_m, unit) for unit, per_m in UNITS if height / per_m <= highest_m]
    if read_m < height:  # the whole body is in another unit
        possible = [(read_m, "")] if read_m <= largest_m else []
    if possible and not reading.is_over_limit:
        height_m, unit = possible[0]
        note = (converted_text(what, unit, "its length and width", largest_m),) if unit else ()
        return _of_height(reading, height_m, SIZE_IN_OTHER_UNIT, note)
    return _of_height(reading, largest_m, SIZE_OVER_LIMIT, (over_limit_text(what, largest_m),))


def _of_height(reading: BodyReading, height_m: float, rule: str = "", notes: tuple[str, ...] = ()) -> BodyReading:
    if height_m == reading.body.envelope_m[2] and not rule:
        return reading
    length_m, width_m, _ = reading.body.envelope_m
    rules = tuple(dict.fromkeys((*reading.rules, *([rule] if rule else ()))))
    return BodyReading(reading.body._replace(envelope_m=(length_m, width_m, height_m)), rules, reading.notes + notes)


def _with_offset(what: str, stated: StatedBody) -> str:
    return f"{what} around {size_text(*stated.offset_m).replace(' x ', ', ')}" if any(stated.offset_m) else what
