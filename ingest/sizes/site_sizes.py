"""Sizes in the site file: those beyond the limit, and those that show in which unit robots state theirs."""

from collections.abc import Iterable, Iterator

from ingest.settings import Envelope, Model, Reading, Vendor
from ingest.shapes import Shape, ShapePart
from ingest.sizes.size_limit import Rectangle
from ingest.sizes.stated_bodies import Figure

_Sized = tuple[str, Rectangle, float]
"""A key, the rectangle that it states, and its height."""


def site_figures(vendor: Vendor, model: Model) -> list[Figure]:
    """The sizes that the site file states of a vendor's robots and of a model."""
    stated = (
        (model.envelope_m, "envelope_m of its model in the site file"),
        (model.loaded_envelope_m, "loaded_envelope_m of its model in the site file"),
        (vendor.default_envelope_m, "default_envelope_m of its vendor in the site file"),
    )
    figures = [Figure(*envelope_m[:2], source) for envelope_m, source in stated if envelope_m]
    if parts := _parts(model):
        west, south, east, north = Shape(parts).bounds_m
        figures.insert(0, Figure(east - west, north - south, "the shape of its model in the site file"))
    return figures


def size_problems(vendors: Iterable[Vendor], reading: Reading) -> Iterator[str]:
    """A sentence for each size of the site file that is beyond its limit, with its key."""
    sizes = [_of_envelope("reading.default_envelope_m", reading.default_envelope_m)]
    for row, vendor in enumerate(vendors):
        sizes += _of_vendor(f"vendors[{row}]", vendor)
    limit_m = reading.largest_body_m
    for key, rectangle, height_m in sizes:
        if height_m > limit_m or not rectangle.is_within(limit_m):
            yield (
                f"{key}: is larger than reading.largest_body_m = {limit_m:g} m, or so far from the reported location; "
                "expected metres, or a larger limit"
            )


def _of_envelope(key: str, envelope_m: Envelope | None, offset_m: tuple[float, float] = (0.0, 0.0)) -> _Sized:
    length_m, width_m, height_m = envelope_m or (0.0, 0.0, 0.0)
    return key, Rectangle.about(offset_m, length_m, width_m), height_m


def _of_vendor(key: str, vendor: Vendor) -> Iterator[_Sized]:
    yield _of_envelope(f"{key}.default_envelope_m", vendor.default_envelope_m)
    for name, model in vendor.models.items():
        yield from _of_model(f"{key}.models.{name}", model)


def _of_model(key: str, model: Model) -> Iterator[_Sized]:
    envelope_m, parts = model.envelope_m, _parts(model)
    if parts:
        name = "parts" if model.parts else "diameter_m" if model.diameter_m else "footprint_m"
        west, south, east, north = Shape(parts).bounds_m
        height_m = max((part.top_m for part in model.parts), default=0.0)
        yield f"{key}.{name}", Rectangle(west, east, south, north), height_m
    if envelope_m and not parts:
        yield _of_envelope(f"{key}.envelope_m", envelope_m, model.offset_m)
    elif envelope_m:  # only its height counts
        yield _of_envelope(f"{key}.envelope_m", (0.0, 0.0, envelope_m[2]))
    elif not parts:
        yield _of_envelope(f"{key}.offset_m", None, model.offset_m)
    if model.loaded_envelope_m:
        offset_m = model.loaded_offset_m or model.offset_m
        yield _of_envelope(f"{key}.loaded_envelope_m", model.loaded_envelope_m, offset_m)
    if pulled := model.trailers:
        sides_m = {"length_m": pulled.length_m, "width_m": pulled.width_m, "hitch_m": pulled.hitch_m}
        for name, side_m in sides_m.items():
            yield f"{key}.trailers.{name}", Rectangle.about((0.0, 0.0), side_m, 0.0), 0.0


def _parts(model: Model) -> tuple[ShapePart, ...]:
    if model.parts:
        return tuple(part.shape_part() for part in model.parts)
    part = model.round_part()
    return (part,) if part else ()
