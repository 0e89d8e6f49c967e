"""Open-RMF building files in longitude and latitude: from degrees to metres of the grid that the file names.

Open-RMF's tools write their navigation graphs in that grid, east and north, and robots of Open-RMF report in it. The
offset that the file suggests is for simulators only.
"""

from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any

from deconflict.settings.importers.formats.openrmf.rmf_entries import PlanLevel
from deconflict.settings.importers.plan import PlanError, Spot

STRETCHED = 0.01
"""Share by which a grid may stretch distances."""


def grid_of(document: Mapping[str, Any], levels: Mapping[str, PlanLevel]) -> tuple[str, Callable[[Spot], Spot]]:
    """The grid's name, and from longitude and latitude to metres on it."""
    from pyproj import CRS, Proj, Transformer  # noqa: PLC0415 - takes 18 MB, and most plans are in pixels
    from pyproj.exceptions import CRSError  # noqa: PLC0415

    longitude, latitude = _first_spot(levels)
    utm = f"EPSG:{32601 + int((longitude + 180) // 6) % 60 + (100 if latitude < 0 else 0)}"
    where = "parameters.generate_crs"
    named = (document.get("parameters") or {}).get("generate_crs")
    if not named:
        raise PlanError(f"{where}: is missing; name the grid of your robots, in metres, such as {utm}")
    name = str(named[1] if isinstance(named, list) else named)
    try:
        grid = CRS(name)
    except CRSError as error:
        raise PlanError(f"{where}: {name!r} is no known grid; name one in metres, such as {utm}") from error
    if not grid.is_projected or any(axis.unit_name != "metre" for axis in grid.axis_info):
        raise PlanError(f"{where}: {name} is not in metres; name a grid in metres, such as {utm}")
    factors = Proj(grid).get_factors(longitude, latitude)
    stretch = max(abs(factors.meridional_scale - 1), abs(factors.parallel_scale - 1))
    if not stretch <= STRETCHED:
        raise PlanError(f"{where}: {name} is wrong by {stretch:.0%} in distances there; name another, such as {utm}")
    to_grid = Transformer.from_crs("EPSG:4326", grid, always_xy=True)

    def to_metres(at: Spot) -> Spot:
        east, north = to_grid.transform(*at)
        if not (isfinite(east) and isfinite(north)):
            raise PlanError(f"longitude {at[0]:g} and latitude {at[1]:g} are not on the grid {name}; correct them")
        return float(east), float(north)

    return name, to_metres


def _first_spot(levels: Mapping[str, PlanLevel]) -> Spot:
    for level in levels.values():
        for row, vertex in enumerate(level.vertices):
            if abs(vertex.at[0]) > 180 or abs(vertex.at[1]) > 90:
                raise PlanError(f"levels.{level.name}.vertices.{row}: must be longitude and latitude in degrees")
    return next(vertex.at for level in levels.values() for vertex in level.vertices)
