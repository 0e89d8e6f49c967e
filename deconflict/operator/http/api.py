"""The operator face: advisories, robots, rejected messages, health and metrics over HTTP, as an ASGI application.

It reads the store itself and asks everything else of its `Sources` when it is asked. The stream is in
`deconflict/operator/live/advisory_stream.py`; how the application is served, in
`deconflict/operator/http/uvicorn_server.py`.
"""

from collections.abc import Callable
from datetime import UTC, datetime
from html import escape
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Protocol

from fastapi import FastAPI, HTTPException, Query, Request, Response, WebSocket
from fastapi.responses import FileResponse, HTMLResponse
from pydantic import BaseModel, Field, StringConstraints
from pydantic_core import to_json

from deconflict.advisory import Acknowledgement, AnyAdvisory, Kind
from deconflict.operator.http.access import Access, People
from deconflict.operator.http.json_schemas import SCHEMAS
from deconflict.operator.http.page_routes import FloorSource, add_view
from deconflict.operator.live.advisory_stream import Stream
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.store import StateFilter, Store, StoreError
from deconflict.operator.vendor_health import VendorList, vendor_health
from deconflict.settings.site import Site
from ingest.measures.measures import Measures

Document = dict[str, Any]
Exposition = Callable[[list[Document]], tuple[bytes, str]]
"""Documents of `Measures.as_document()` to the text of a scrape and its content type."""

MOST_LISTED = 1000

DESCRIPTION = """Predicted conflicts and contention of the robots of many vendors on shared floors.
**Advisory, not safety rated**: nothing here stops a robot or replaces a safety function.

Live advisories come over a WebSocket at `/advisories/stream`; with `?after=SEQ` it first replays every revision
with a higher number."""


class SourceUnavailableError(Exception):
    """A role that was asked did not answer."""

    def __init__(self, role: str) -> None:
        super().__init__(f"the {role} does not answer")
        self.role = role


class Sources(FloorSource, Protocol):
    """What the other roles know. Each call raises `SourceUnavailableError` where a role does not answer."""

    async def robots(self) -> list[Document]:
        """Everything each robot said and what was derived from it, with at least `uuid` and `vendor`."""

    async def quarantine(self) -> list[Document]:
        """The rejected messages that are kept."""

    async def measures(self) -> list[Document]:
        """`Measures.as_document()` of each role that answers, the operator face left out."""

    async def health(self) -> Document:
        """`status`, "ok" or "degraded", and `roles`."""

    def blackboxes(self) -> list[Document]:
        """What is in each black box, the newest last. Raises `OSError`."""

    def blackbox(self, file: str) -> Path | None:
        """Where one is, None where there is no such."""

    async def reload(self) -> Document:
        """Have the site file read again: a `Reloaded`, JSON-ready."""


class AdvisoryList(BaseModel):
    """The newest revision of each advisory that matches, newest first."""

    seq: int = Field(description="the newest number when this was read: `/advisories/stream?after=` it goes on")
    advisories: list[AnyAdvisory]
    more: bool = Field(description="true where `limit` left some out")


class RevisionList(BaseModel):
    """Every stored revision of one advisory, in order."""

    advisories: list[AnyAdvisory]


class Answer(BaseModel):
    """Who takes an advisory up, and what is done about it or why nothing is."""

    name: Annotated[str, StringConstraints(strip_whitespace=True, max_length=80)] = Field(
        default="", description="needed where people don't sign in; who has signed in is named by that"
    )
    reason: Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=500)]


class RobotList(BaseModel):
    """Every robot that was heard, as it described itself and as it is understood."""

    robots: list[Document]


class QuarantineList(BaseModel):
    """The rejected messages that are kept, each with its rule and reason."""

    rejected: list[Document]


class BlackBoxList(BaseModel):
    """The black boxes that are kept, the newest last: when, who, how near, and what would have avoided it."""

    blackboxes: list[Document]


class Reloaded(BaseModel):
    """What became of a changed site file."""

    applied: bool = Field(description="false where it was refused; then the old settings hold")
    problems: list[str] = Field(description="what to change in it")
    needs_restart: list[str] = Field(description="changed keys that hold after a restart")


class Problem(BaseModel):
    """Why an answer can't be given, and which role is the cause."""

    detail: str
    role: str


class Face:
    """The routes' common state; each method answers one route."""

    def __init__(self, publisher: Publisher, store: Store, sources: Sources, exposition: Exposition) -> None:
        self._publisher, self._store, self._sources, self._exposition = publisher, store, sources, exposition

    def advisories(
        self,
        state: Annotated[StateFilter, Query(description="which advisories")] = "open",
        kind: Annotated[Kind | None, Query(description="of this kind")] = None,
        vendor: Annotated[str | None, Query(description="with a robot of this vendor")] = None,
        robot: Annotated[str | None, Query(description="with this robot (UUID)")] = None,
        limit: Annotated[int, Query(ge=1, le=MOST_LISTED, description="at most so many")] = 100,
    ) -> Response:
        """The newest revision of each advisory, newest first."""
        listing = self._store.latest(state, kind=kind, vendor=vendor, robot=robot and robot.lower(), limit=limit)
        return _json(AdvisoryList(seq=listing.seq, advisories=listing.advisories, more=listing.more))

    def advisory(self, advisory_id: str) -> Response:
        """Every revision of one advisory."""
        revisions = self._store.get(advisory_id)
        if not revisions:
            raise HTTPException(404, f"no advisory {advisory_id!r} is stored; cleared ones are removed in time")
        return _json(RevisionList(advisories=revisions))

    async def acknowledge(self, advisory_id: str, answer: Answer, request: Request) -> Response:
        """Take an advisory up by name and with a reason; everybody sees it, and the stream carries it."""
        name = getattr(request.state, "person", None) or answer.name
        if not name:
            raise HTTPException(422, "name: is empty; expected who acknowledges")
        given = Acknowledgement(name=name, reason=answer.reason, at=datetime.now(UTC))
        answered = await self._publisher.acknowledge(advisory_id, given)
        if answered is None:
            raise HTTPException(404, f"no advisory {advisory_id!r} is stored; cleared ones are removed in time")
        return _json(answered, 201)

    async def robots(
        self, vendor: Annotated[str | None, Query(description="only robots of this vendor")] = None
    ) -> Response:
        """Everything each robot said, and how it is understood."""
        robots = await self._sources.robots()
        return _json({"robots": [one for one in robots if vendor in (None, one["vendor"])]})

    async def robot(self, uuid: str) -> Response:
        """Everything one robot said."""
        for one in await self._sources.robots():
            if one["uuid"] == uuid.lower():
                return _json(one)
        raise HTTPException(404, f"no robot {uuid!r} has been heard")

    async def vendors(self) -> Response:
        """How each vendor does: its robots, messages, clocks, forecasts, grade, and what has changed of it."""
        return _json(VendorList(vendors=vendor_health(await self._sources.measures())))

    async def quarantine(self) -> Response:
        """Rejected messages, each with its rule and reason."""
        return _json({"rejected": await self._sources.quarantine()})

    def blackboxes(self) -> Response:
        """Near misses, each with the file of what was heard and decided around it."""
        return _json({"blackboxes": self._sources.blackboxes()})

    def blackbox(self, file: str) -> Response:
        """One black box, as JSON lines packed with zstd; `deconflict blackbox verify` proves it whole."""
        path = self._sources.blackbox(file)
        if path is None:
            raise HTTPException(404, f"there is no black box {file!r}; the oldest are removed in time")
        return FileResponse(path, media_type="application/zstd", filename=file)

    async def healthz(self) -> Response:
        """200 if every role and the store answer, else 503 with the same document."""
        try:
            health = await self._sources.health()
        except SourceUnavailableError as error:
            health = {"status": "degraded", "roles": {error.role: "down"}}
        try:
            stored = {"status": "ok", "seq": self._store.last_seq()}
            if self._publisher.failing:
                unstored = {"reason": self._publisher.failing, "unstored": self._store.unstored}
                stored |= {"status": "failing", **unstored}
        except StoreError as error:
            stored = {"status": "failing", "reason": str(error)}
        if stored["status"] != "ok":
            health = health | {"status": "degraded"}
        return _json(health | {"store": stored}, 200 if health["status"] == "ok" else 503)

    async def reload(self) -> Response:
        """Read the site file again and take up what has changed; 422 where the old settings hold."""
        told = Reloaded.model_validate(await self._sources.reload())
        return _json(told, 200 if told.applied else 422)

    async def metrics(self) -> Response:
        """Prometheus text; what a role that does not answer would have said is left out."""
        try:
            documents = await self._sources.measures()
        except SourceUnavailableError as error:
            down = Measures()
            down.level("deconflict_role_up", {(error.role,): 0})
            documents = [down.as_document()]
        body, content_type = self._exposition([*documents, self._publisher.measures.as_document()])
        return Response(body, headers={"content-type": content_type})

    def schema(self) -> Response:
        """JSON Schema of an advisory."""
        return _json(SCHEMAS["advisory"](), media_type="application/schema+json")


def create_app(store: Store, sources: Sources, exposition: Exposition, site: Site) -> FastAPI:
    """The application. `app.state.publisher` publishes advisories, `app.state.measures` are the face's own.

    `app.state.site` is what it tells of the site and `app.state.people` who may ask; both may change as it runs.
    """
    app = FastAPI(
        title="amr-deconflict",
        version=version("amr-deconflict"),
        description=DESCRIPTION,
        docs_url=None,
        redoc_url=None,
    )
    measures, settings = Measures(), site.operator
    measures.level("deconflict_build_info", {(app.version,): 1})
    measures.begin(
        "deconflict_advisories_stored_total", "deconflict_store_failures_total", "deconflict_stream_dropped_total"
    )
    publisher = Publisher(store, measures)
    app.state.publisher, app.state.measures = publisher, measures
    app.state.site, app.state.people = site, People(settings.people)
    app.add_middleware(Access, settings=settings, people=app.state.people)
    _add_routes(app, Face(publisher, store, sources, exposition))

    def send_timeout_s() -> float:
        return float(app.state.site.operator.stream_send_timeout_s)

    stream = Stream(store, publisher, measures, send_timeout_s)

    @app.websocket("/advisories/stream")
    async def follow(websocket: WebSocket) -> None:
        await stream.serve(websocket)

    add_view(app, publisher, store, sources, send_timeout_s)

    @app.get("/api", include_in_schema=False)
    async def index() -> HTMLResponse:
        return HTMLResponse(_index(app))

    app.add_exception_handler(SourceUnavailableError, _source_unavailable)
    app.add_exception_handler(StoreError, _store_failed)
    return app


def _add_routes(app: FastAPI, face: Face) -> None:
    unavailable: dict[int | str, Document] = {503: {"model": Problem, "description": "A role does not answer"}}
    missing: dict[int | str, Document] = {404: {"description": "There is none"}}
    degraded: dict[int | str, Document] = {503: {"description": "A role or the store does not answer"}}
    text: dict[int | str, Document] = {200: {"content": {"text/plain": {"schema": {"type": "string"}}}}}

    zstd: dict[int | str, Document] = {200: {"content": {"application/zstd": {}}}}

    get = app.get
    get("/advisories", response_model=AdvisoryList, responses=unavailable)(face.advisories)
    get("/advisories/{advisory_id}", response_model=RevisionList, responses=unavailable | missing)(face.advisory)
    app.post(
        "/advisories/{advisory_id}/acknowledgement",
        response_model=AnyAdvisory,
        status_code=201,
        responses=unavailable | missing,
    )(face.acknowledge)
    refused: dict[int | str, Document] = {422: {"model": Reloaded, "description": "The file can't be used"}}
    app.post("/site/reload", response_model=Reloaded, responses=unavailable | refused)(face.reload)
    get("/robots", response_model=RobotList, responses=unavailable)(face.robots)
    get("/robots/{uuid}", response_model=Document, responses=unavailable | missing)(face.robot)
    get("/vendors", response_model=VendorList, responses=unavailable)(face.vendors)
    get("/quarantine", response_model=QuarantineList, responses=unavailable)(face.quarantine)
    get("/blackboxes", response_model=BlackBoxList)(face.blackboxes)
    get("/blackboxes/{file}", response_class=Response, responses=missing | zstd)(face.blackbox)
    get("/healthz", response_model=Document, responses=degraded)(face.healthz)
    get("/metrics", response_class=Response, responses=text)(face.metrics)
    get("/schema/advisory", response_model=Document)(face.schema)


def _json(content: object, status: int = 200, media_type: str = "application/json") -> Response:
    """Numbers that JSON does not know become null."""
    return Response(to_json(content, inf_nan_mode="null"), status, media_type=media_type)


async def _source_unavailable(_: Request, error: Exception) -> Response:
    role = error.role if isinstance(error, SourceUnavailableError) else "unknown"
    return _json(Problem(detail=f"{error}; try again shortly, or see /healthz", role=role), 503)


async def _store_failed(_: Request, error: Exception) -> Response:
    return _json(Problem(detail=str(error), role="store"), 503)


def _index(app: FastAPI) -> str:
    rows = [
        f"<dt><code>{_linked(path)}</code></dt><dd>{escape(method['description'])}</dd>"
        for path, methods in app.openapi()["paths"].items()
        for method in methods.values()
    ]
    return f"""<!doctype html>
<html lang="en"><meta charset="utf-8"><title>{escape(app.title)}</title>
<h1>{escape(app.title)} {escape(app.version)}</h1>
<p>Predicted conflicts and contention of robots. <strong>Advisory, not safety rated.</strong></p>
<dl>{"".join(rows)}
<dt><code>/advisories/stream?after=SEQ</code></dt><dd>WebSocket: each revision as it is published.</dd>
<dt><code>/live</code></dt><dd>WebSocket: the floor as the page draws it.</dd>
<dt><code>{_linked("/openapi.json")}</code></dt><dd>The description of this interface.</dd></dl></html>
"""


def _linked(path: str) -> str:
    return escape(path) if "{" in path else f'<a href="{escape(path)}">{escape(path)}</a>'
