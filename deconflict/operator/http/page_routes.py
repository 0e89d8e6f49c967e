"""The page and the routes that it uses: the site, the live floor, the floor in the past, and the heat map."""

import asyncio
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from importlib.resources import files
from importlib.resources.abc import Traversable
from math import floor
from pathlib import Path
from typing import Annotated, Any

from fastapi import FastAPI, HTTPException, Query, Response, WebSocket
from pydantic_core import to_json

from deconflict.advisories.situations.situation_counts import counted
from deconflict.operator.http.api_routes import json_response
from deconflict.operator.http.api_sources import FloorSource
from deconflict.operator.live.live_socket import LiveSocket
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.store import Store
from deconflict.settings.floor_plan import IMAGES, image_matrix
from deconflict.settings.shared_places import FloorPart, Resource, Zone, outlines
from deconflict.settings.site import Site
from deconflict_client.answers.api_models import Heat, PastFloor, Recorded, Shift, StillThere
from deconflict_client.answers.site_models import SiteMap
from deconflict_client.situations import advisories_of, situations_of

HEAT_CELL_M = 1.0
HEAT_S = 3600.0
MOST_OF_A_SHIFT = 5000
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


class PageRoutes:
    """One method for each route."""

    def __init__(self, app: FastAPI, store: Store, source: FloorSource) -> None:
        self._app, self._store, self._source = app, store, source
        self._page = page_files()

    def page(self) -> Response:
        return self._file("index.html")

    def file(self, name: str) -> Response:
        return self._file(name)

    def site(self) -> Response:
        """The floors with their marks, resources, zones and obstacles, and the settings that the page shows."""
        return json_response(site_document(self._app.state.site))

    def plan(self, datum: str) -> Response:
        """The image of a floor, from the site file."""
        for floor_datum in self._app.state.site.datums:
            plan = floor_datum.plan
            if floor_datum.id == datum.lower() and plan and Path(plan.image).is_file():
                kind = IMAGES[Path(plan.image).suffix.casefold()]
                return Response(Path(plan.image).read_bytes(), headers=HEADERS, media_type=kind)
        raise HTTPException(404, f"there is no image of the floor {datum!r}")

    async def recorded(self) -> Response:
        """The time span for which `/past` has answers."""
        from_s, to_s = await self._source.recorded() or (None, None)
        return json_response(Recorded(from_s=from_s, to_s=to_s))

    def presence(self) -> Response:
        """The probability that each silent robot is still there, the robots that are gone, and the usual exits."""
        return json_response(self._source.presence())

    async def past(
        self, at_s: Annotated[float, Query(ge=0, allow_inf_nan=False, description="seconds since the epoch")]
    ) -> Response:
        """The floor, the open situations and the open advisories at a time, from the recording and the store."""
        frame = await self._source.floor_at(at_s)
        revisions = await asyncio.to_thread(self._store.open_at, at_s)
        situations, advisories = to_json(situations_of(revisions)), to_json(advisories_of(revisions))
        body = b'{"floor": %b, "situations": %b, "advisories": %b}' % (frame.encode(), situations, advisories)
        return Response(body, media_type="application/json")

    def heat(
        self,
        until_s: Annotated[
            float | None, Query(ge=0, allow_inf_nan=False, description="seconds since the epoch; now if absent")
        ] = None,
    ) -> Response:
        """Where advisories were raised in the hour before."""
        end_s = time.time() if until_s is None else until_s
        counts: dict[str, Counter[tuple[float, float]]] = {}
        for place, count in self._store.raised_between(end_s - HEAT_S, end_s).items():
            counts.setdefault(place.datum, Counter())[_cell(place.x), _cell(place.y)] += count
        floors = {datum: [(*cell, count) for cell, count in cells.items()] for datum, cells in counts.items()}
        return json_response(Heat(since_s=end_s - HEAT_S, until_s=end_s, cell_m=HEAT_CELL_M, floors=floors))

    def shift(self, since_s: Annotated[float, Query(ge=0, allow_inf_nan=False)]) -> Response:
        """The situations that were open since a time, at most 5,000, with how severe each was at worst."""
        rows = self._store.situations_since(since_s, MOST_OF_A_SHIFT)
        situations = b",".join(
            b'{"situation": %b, "first_kind": "%b", "worst_severity": "%b", "most_cost_s": %.1f}'
            % (row.document.encode(), row.first_kind.encode(), row.worst_severity.encode(), row.most_cost_s)
            for row in rows
        )
        counts = to_json(counted((row.id, row.first_kind) for row in rows))
        complete = b"true" if len(rows) < MOST_OF_A_SHIFT else b"false"
        body = b'{"since_s": %.3f, "complete": %b, "counts": %b, "situations": [%b]}' % (
            since_s,
            complete,
            counts,
            situations,
        )
        return Response(body, media_type="application/json")

    def _file(self, name: str) -> Response:
        content = self._page.get(name)
        if content is None:
            raise HTTPException(404, f"the page has no file {name!r}")
        kind = KINDS["." + name.rpartition(".")[2]]
        return Response(content, headers=HEADERS, media_type=f"{kind}; charset=utf-8")


def add_page_routes(
    app: FastAPI, publisher: Publisher, store: Store, source: FloorSource, send_timeout_s: Callable[[], float]
) -> None:
    """Serve the page and the routes that it uses."""
    routes, measures = PageRoutes(app, store, source), app.state.measures
    live_socket = LiveSocket(source.follow, source.live_status, lambda: publisher.last_seq, measures, send_timeout_s)
    app.get("/", include_in_schema=False)(routes.page)
    app.get("/page/{name:path}", include_in_schema=False)(routes.file)
    app.get("/site", response_model=SiteMap)(routes.site)
    app.get("/plans/{datum}", response_class=Response)(routes.plan)
    app.get("/recorded", response_model=Recorded)(routes.recorded)
    app.get("/past", response_model=PastFloor)(routes.past)
    app.get("/heat", response_model=Heat)(routes.heat)
    app.get("/shift", response_model=Shift)(routes.shift)
    app.get("/presence", response_model=StillThere)(routes.presence)

    @app.websocket("/live")
    async def live(websocket: WebSocket) -> None:
        await live_socket.serve(websocket)


def page_files() -> Mapping[str, bytes]:
    """The files of the page by their paths within its folder, from the package."""
    return dict(_files_in(files("deconflict.operator").joinpath("page")))


def _files_in(folder: Traversable, path: str = "") -> Iterator[tuple[str, bytes]]:
    for entry in folder.iterdir():
        if entry.is_dir():
            yield from _files_in(entry, f"{path}{entry.name}/")
        else:
            yield path + entry.name, entry.read_bytes()


def _floor_part(part: FloorPart, site: Site) -> dict[str, Any]:
    return {"name": part.name, "floor": part.floor or site.datums[0].id, "polygon": part.outline_m}


def site_document(site: Site) -> dict[str, Any]:
    """What the page draws below the robots, in the frame of each floor."""
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
            "marks": [point.model_dump() for point in datum.reference_points if datum.coordinates == "metres"],
            "plan": {"image": f"/plans/{datum.id}", "matrix": image_matrix(datum.plan, datum)} if datum.plan else None,
        }
        for datum in sorted(site.datums, key=lambda datum: datum.level)
    ]
    return {
        "name": site.name,
        "floors": floors,
        "places": drawn,
        "areas": [_floor_part(area, site) | {"keep_clear": area.keep_clear} for area in site.areas],
        "obstacles": [_floor_part(obstacle, site) | {"kind": obstacle.kind} for obstacle in site.obstacles],
        "clearance_m": site.conflict.clearance_m,
        "horizon_s": site.conflict.horizon_s,
        "quiet_after_s": site.reading.quiet_after_s,
        "silent_after_s": site.reading.silent_after_s,
        "vendors": [{"name": vendor.name, "participant": vendor.participant} for vendor in site.vendors],
        "sign_in": bool(site.operator.people),
    }


def _cell(metres: float) -> float:
    return floor(metres / HEAT_CELL_M) * HEAT_CELL_M
