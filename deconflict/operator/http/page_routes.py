"""What the page asks for: the page itself, the site, the live picture, the past, and where conflicts arise."""

import asyncio
import time
from collections import Counter
from collections.abc import Callable, Mapping
from importlib.resources import files
from math import floor
from pathlib import Path
from typing import Annotated, Any, Protocol

from fastapi import FastAPI, HTTPException, Query, Response, WebSocket
from pydantic import BaseModel, Field
from pydantic_core import to_json

from deconflict.advisory import AnyAdvisory
from deconflict.operator.live.live_socket import Viewers
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.store import Store
from deconflict.settings.floor_plan import IMAGES, matrix
from deconflict.settings.shared_places import Resource, Zone, outlines
from deconflict.settings.site import Site
from ingest.batch import Batch

HEAT_CELL_M = 1.0
HEAT_S = 3600.0
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
)
KINDS = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-cache",
}


class FloorSource(Protocol):
    """What the view needs of the other roles."""

    async def follow(self, number: int) -> tuple[int, bool, Batch | None]:
        """See `Viewers`; raises `ConnectionError`."""

    async def pulse(self) -> dict[str, Any]:
        """How the roles and the vendors do, and which robots are unidentified; never raises."""

    async def floor_at(self, at_s: float) -> str:
        """The floor as it was, a frame of `Picture`; raises `SourceUnavailableError`."""

    def recorded(self) -> tuple[float, float] | None:
        """From when to when the past can be had; None where nothing is recorded."""

    def still_there(self) -> dict[str, Any]:
        """Who is still there of the silent robots: a `StillThere`, JSON-ready."""


class Recorded(BaseModel):
    """From when to when the past can be had, seconds since the epoch; null where nothing is recorded."""

    from_s: float | None
    to_s: float | None


class PastFloor(BaseModel):
    """The floor and the open advisories at one moment."""

    floor: dict[str, Any] = Field(description="a frame as `/live` sends it")
    advisories: list[AnyAdvisory]


class Heat(BaseModel):
    """Where advisories arose: by floor, `[x, y, count]` of each cell that has any, its lower left corner."""

    since_s: float
    until_s: float
    cell_m: float
    floors: dict[str, list[tuple[float, float, int]]]


class Removed(BaseModel):
    """A robot through whose place another one has driven: it is not there, until it reports again."""

    vendor: str
    name: str
    heard_s: float = Field(description="when it was last heard, seconds since the epoch")
    at_s: float = Field(description="when the other one drove through its place")
    by: str = Field(description="the name of the other one")


class Exit(BaseModel):
    """Where robots usually leave: they fall silent there and do not come back."""

    datum: str
    x_m: float
    y_m: float
    robots: int = Field(description="how many left there, lately")


class StillThere(BaseModel):
    """Of robots that are silent, by UUID: how likely each is still there, and which are not; and the exits."""

    fading: dict[str, float]
    taken_off: dict[str, Removed]
    exits: list[Exit]


class View:
    """The routes' common state; each method answers one route."""

    def __init__(self, app: FastAPI, store: Store, source: FloorSource) -> None:
        self._app, self._store, self._source = app, store, source
        self._page = page_files()

    def page(self) -> Response:
        return self._file("index.html")

    def file(self, name: str) -> Response:
        return self._file(name)

    def site(self) -> Response:
        """The floors, their marks, resources and zones, and what counts as near and as silent."""
        return _json(site_document(self._app.state.site))

    def plan(self, datum: str) -> Response:
        """The image of a floor, as the site file has it."""
        for one in self._app.state.site.datums:
            if one.id == datum.lower() and one.plan and Path(one.plan.image).is_file():
                kind = IMAGES[Path(one.plan.image).suffix.casefold()]
                return Response(Path(one.plan.image).read_bytes(), headers=HEADERS, media_type=kind)
        raise HTTPException(404, f"there is no image of the floor {datum!r}")

    def recorded(self) -> Response:
        """From when to when `/past` can answer."""
        from_s, to_s = self._source.recorded() or (None, None)
        return _json(Recorded(from_s=from_s, to_s=to_s))

    def presence(self) -> Response:
        """How likely silent robots are still there, which are not, and where robots usually leave."""
        return _json(self._source.still_there())

    async def past(
        self, at_s: Annotated[float, Query(ge=0, allow_inf_nan=False, description="seconds since the epoch")]
    ) -> Response:
        """The floor and the open advisories as they were, from the recording and the store."""
        frame = await self._source.floor_at(at_s)
        advisories = await asyncio.to_thread(lambda: to_json(self._store.open_at(at_s)))
        return Response(
            b'{"floor": %b, "advisories": %b}' % (frame.encode(), advisories), media_type="application/json"
        )

    def heat(
        self,
        until_s: Annotated[float | None, Query(ge=0, allow_inf_nan=False, description="now if absent")] = None,
    ) -> Response:
        """Where advisories arose in the hour before."""
        end_s = time.time() if until_s is None else until_s
        counts: dict[str, Counter[tuple[float, float]]] = {}
        for one in self._store.raised(end_s - HEAT_S, end_s):
            if one.location:
                cell = (_cell(one.location.x), _cell(one.location.y))
                counts.setdefault(one.location.datum, Counter())[cell] += 1
        floors = {datum: [(*cell, count) for cell, count in cells.items()] for datum, cells in counts.items()}
        return _json(Heat(since_s=end_s - HEAT_S, until_s=end_s, cell_m=HEAT_CELL_M, floors=floors))

    def _file(self, name: str) -> Response:
        content = self._page.get(name)
        if content is None:
            raise HTTPException(404, f"the page has no file {name!r}")
        kind = KINDS["." + name.rpartition(".")[2]]
        return Response(content, headers=HEADERS, media_type=f"{kind}; charset=utf-8")


def add_view(
    app: FastAPI, publisher: Publisher, store: Store, source: FloorSource, send_timeout_s: Callable[[], float]
) -> None:
    """Serve the page and what it asks for."""
    view = View(app, store, source)
    viewers = Viewers(source.follow, source.pulse, publisher.measures, send_timeout_s)
    app.get("/", include_in_schema=False)(view.page)
    app.get("/page/{name}", include_in_schema=False)(view.file)
    app.get("/site", response_model=dict[str, Any])(view.site)
    app.get("/plans/{datum}", response_class=Response)(view.plan)
    app.get("/recorded", response_model=Recorded)(view.recorded)
    app.get("/past", response_model=PastFloor)(view.past)
    app.get("/heat", response_model=Heat)(view.heat)
    app.get("/presence", response_model=StillThere)(view.presence)

    @app.websocket("/live")
    async def live(websocket: WebSocket) -> None:
        await viewers.serve(websocket)


def page_files() -> Mapping[str, bytes]:
    """The files of the page by name, from the package."""
    return {
        one.name: one.read_bytes() for one in files("deconflict.operator").joinpath("page").iterdir() if one.is_file()
    }


def site_document(site: Site) -> dict[str, Any]:
    """What the page draws under the robots, in the floors' own frames."""
    places: list[Resource | Zone] = [*site.resources, *site.zones]
    drawn = [
        {
            "id": place.id,
            "name": place.label,
            "kind": place.kind,
            "capacity": place.capacity,
            "floor": datum,
            "polygon": polygon,
        }
        for place in places
        for datum, polygon in outlines(place)
    ]
    floors = [
        {
            "id": datum.id,
            "name": datum.name,
            "level": datum.level,
            "marks": [one.model_dump() for one in datum.reference_points if datum.coordinates == "metres"],
            "plan": {"image": f"/plans/{datum.id}", "matrix": matrix(datum.plan, datum)} if datum.plan else None,
        }
        for datum in sorted(site.datums, key=lambda one: one.level)
    ]
    return {
        "name": site.name,
        "floors": floors,
        "places": drawn,
        "clearance_m": site.conflict.clearance_m,
        "horizon_s": site.conflict.horizon_s,
        "quiet_after_s": site.reading.quiet_after_s,
        "silent_after_s": site.reading.silent_after_s,
        "vendors": [{"name": one.name, "participant": one.participant} for one in site.vendors],
        "sign_in": bool(site.operator.people),
    }


def _cell(metres: float) -> float:
    return floor(metres / HEAT_CELL_M) * HEAT_CELL_M


def _json(content: object) -> Response:
    return Response(to_json(content, inf_nan_mode="null"), media_type="application/json")
