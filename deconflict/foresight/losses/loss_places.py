"""Where losses begin: the named place of the site, and the floor by its id."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple, Self

import shapely

from deconflict.foresight.losses.loss import Loss, LossNotice
from deconflict.settings.shared_places import Point, outlines
from deconflict.settings.site import Site


class PlacedLoss(NamedTuple):
    """A loss and where it began."""

    loss: Loss
    datum: str
    """Id of the floor; "" for a frame that is compared with nothing."""
    place: str
    """Name of the smallest zone, resource or area; "" outside all."""
    notice: LossNotice = LossNotice()


class LossPlaces:
    """The named places of a site, by floor."""

    def __init__(self, places: Iterable[tuple[str, str, Sequence[Point]]]) -> None:
        """`places` are floors, names and outlines."""
        self._outlines: dict[str, list[tuple[float, str, shapely.Polygon]]] = {}
        """By floor, area in square metres, name and outline of each place; the smallest first."""
        for datum, name, points in places:
            outline = shapely.Polygon(points)
            self._outlines.setdefault(datum, []).append((outline.area, name, outline))
        for found in self._outlines.values():
            found.sort(key=lambda entry: entry[:2])

    @classmethod
    def of(cls, site: Site) -> Self:
        shared = [
            (datum, place.label, points)
            for place in (*site.zones, *site.resources)
            for datum, points in outlines(place)
        ]
        areas = [(area.floor or site.datums[0].id, area.name, area.outline_m) for area in site.areas]
        return cls((*shared, *areas))

    def placed(self, losses: Sequence[Loss], floors: Sequence[str]) -> list[PlacedLoss]:
        """The losses with their places. `floors` are the ids of the floors by index."""
        datums = [floors[loss.floor] if loss.floor >= 0 else "" for loss in losses]
        return [
            PlacedLoss(loss, datum, self.place_at(datum, loss.x_m, loss.y_m))
            for loss, datum in zip(losses, datums, strict=True)
        ]

    def place_at(self, datum: str, x_m: float, y_m: float) -> str:
        """The name of the smallest place that holds a point; "" if none does."""
        point = shapely.Point(x_m, y_m)
        return next((name for _, name, outline in self._outlines.get(datum, ()) if outline.covers(point)), "")
