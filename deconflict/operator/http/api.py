"""The operators' HTTP application (ASGI): its routes, and what they share.

It reads the store itself, and asks its `Sources` for everything else at each request. To the OpenAPI
description it adds what FastAPI does not know: credentials, groups of routes, and their refusals.
"""

import json
from functools import cache, partial
from html import escape
from importlib.metadata import version
from typing import Any

from fastapi import Depends, FastAPI, Response, WebSocket
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse
from starlette.exceptions import HTTPException

from deconflict.operator.http.access import AccessMiddleware, People
from deconflict.operator.http.api_routes import AdviceRoutes, ApiRoutes, failed, source_unavailable, store_failed
from deconflict.operator.http.api_sources import Exposition, Sources, SourceUnavailableError
from deconflict.operator.http.filter_names import NamesInFilters
from deconflict.operator.http.off_floor_routes import add_off_floor_routes
from deconflict.operator.http.page_routes import add_page_routes
from deconflict.operator.http.request_limits import (
    RequestLimitsMiddleware,
    invalid_request,
    refuse_unknown_parameters,
    unknown_address,
)
from deconflict.operator.http.server.server_protocols import Places
from deconflict.operator.ledger.loss_routes import add_loss_routes
from deconflict.operator.live.advisory_stream import AdvisoryStream
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.store import Store, StoreError
from deconflict.operator.suggestions.suggestion_routes import add_suggestion_routes
from deconflict.settings.site import Site
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.answers.api_models import (
    AdviceList,
    AdviceRevisions,
    AdvisoryList,
    Document,
    Owned,
    Problem,
    QuarantineList,
    RefusedRequest,
    Reloaded,
    RevisionList,
    SituationList,
    SituationRevisions,
)
from deconflict_client.answers.blackbox_models import BlackBoxList
from deconflict_client.answers.health_models import ServiceHealth
from deconflict_client.answers.robot_models import HeardRobot, RobotList
from deconflict_client.answers.vendor_models import VendorList
from deconflict_client.situations import AnyRevision, Situation
from ingest.measures.measures import Measures

GROUPS = {
    "situations": ("What people should look at", ("situations", "shift")),
    "advisories": ("What programs follow", ("advisories", "advice", "heat")),
    "floor": (
        "Robots and vendors, as they report, and the time that they lose",
        ("losses", "suggestions", "robots", "vendors", "quarantine", "presence"),
    ),
    "map": ("What a map shows", ("site", "plans", "recorded", "past")),
    "operation": ("State of the service", ("healthz", "metrics", "blackboxes", "schema")),
}
"""By tag, its description and the first parts of its paths."""
REFUSALS = {
    "401": "No credentials, or wrong ones, where the site file names people",
    "403": "Their role may not do this",
}
OPEN_TO_ALL = ("/healthz",)
REFUSED = RefusedRequest.__name__
VALIDATION_MODELS = ("HTTPValidationError", "ValidationError")
"""FastAPI's own, which are never sent."""


def described(document: dict[str, Any]) -> dict[str, Any]:
    """The description with tags, security schemes and refusals."""
    tag_of = {part: tag for tag, (_, parts) in GROUPS.items() for part in parts}
    for path, item in document["paths"].items():
        for operation in item.values():
            operation["tags"] = [tag_of[path.split("/")[1]]]
            if path not in OPEN_TO_ALL:
                operation["responses"] |= {code: {"description": text} for code, text in REFUSALS.items()}
                operation["security"] = [{"token": []}, {}]
            for code, answer in operation["responses"].items():
                if code >= "400" and _has_no_form(answer):
                    answer["content"] = {"application/json": {"schema": {"$ref": f"#/components/schemas/{REFUSED}"}}}
    schemas = document["components"]["schemas"]
    for name in VALIDATION_MODELS:
        schemas.pop(name, None)
    schemas[REFUSED] = RefusedRequest.model_json_schema()
    document["tags"] = [{"name": tag, "description": text} for tag, (text, _) in GROUPS.items()]
    schemes = {"token": {"type": "http", "scheme": "bearer", "description": "token of a person of the site file"}}
    document["components"]["securitySchemes"] = schemes
    return document


def _has_no_form(answer: dict[str, Any]) -> bool:
    """Whether the description does not say what a refusal consists of, or says what FastAPI would send."""
    schema = answer.get("content", {}).get("application/json", {}).get("schema", {})
    return schema.get("$ref", "").rpartition("/")[2] in ("", *VALIDATION_MODELS)


DESCRIPTION = """Predicted conflicts and contention of the robots of many vendors on shared floors.
**Advisory, not safety rated**: nothing here stops a robot or replaces a safety function.

A situation joins open advisories that share robots or a place: one sentence, and one piece of advice.

Live advisories come over a WebSocket at `/advisories/stream`; with `?after=SEQ` it first replays every revision
with a higher number, with `?kinds=situation,advisory` it sends situations, too.

Advice asks one robot for what saves all of them time. It comes over the same stream with `?kinds=advice`."""

Responses = dict[int | str, Document]
UNAVAILABLE: Responses = {503: {"model": Problem, "description": "A role does not answer"}}
MISSING: Responses = {404: {"description": "There is none"}}


def create_app(publisher: Publisher, store: Store, sources: Sources, exposition: Exposition, site: Site) -> FastAPI:
    """The application. `app.state` holds what its owner uses:

    `measures` are its own. `site` is the site that it shows, and `people` are those who may use it; both may change
    while it runs.
    """
    app = FastAPI(
        title="amr-deconflict",
        version=version("amr-deconflict"),
        description=DESCRIPTION,
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
        dependencies=[Depends(refuse_unknown_parameters)],
        generate_unique_id_function=lambda route: route.name,
    )
    undescribed = app.openapi
    app.openapi = lambda: app.openapi_schema or described(undescribed())  # type: ignore[method-assign]
    measures, settings = Measures(), site.operator
    measures.level("deconflict_build_info", {(app.version,): 1})
    measures.begin("deconflict_stream_dropped_total")
    app.state.measures = measures
    app.state.site, app.state.people, app.state.places = site, People(settings.people), Places()
    app.add_middleware(AccessMiddleware, settings=settings, people=app.state.people, signed_in=app.state.places.sign_in)
    app.add_middleware(RequestLimitsMiddleware, places=app.state.places)
    names = NamesInFilters(store, sources, lambda: app.state.site)
    _add_routes(app, ApiRoutes(publisher, store, sources, names, exposition, measures))
    _add_advice_routes(app, AdviceRoutes(publisher, store, names, app.state.people))
    ask = lambda question: sources.losses(question)  # noqa: E731, PLW0108 - a description has no sources
    add_loss_routes(app, ask, names.unknown)
    add_off_floor_routes(app, sources, UNAVAILABLE | MISSING)
    add_suggestion_routes(app, ask, lambda: sources.measures(), lambda: app.state.site)  # noqa: PLW0108
    _add_sockets(app, publisher, store, sources)
    _add_descriptions(app)
    refusals: dict[type[Exception], Any] = {SourceUnavailableError: source_unavailable, StoreError: store_failed}
    refusals |= {Exception: failed, HTTPException: unknown_address}
    for error, refusal in (refusals | {RequestValidationError: invalid_request}).items():
        app.add_exception_handler(error, refusal)
    return app


def _add_routes(app: FastAPI, routes: ApiRoutes) -> None:
    over: Responses = {409: {"description": "It is cleared, or the site file says otherwise"}}
    degraded: Responses = {503: {"model": ServiceHealth, "description": "A role or the store does not answer"}}
    text: Responses = {200: {"content": {"text/plain": {"schema": {"type": "string"}}}}}
    zstd: Responses = {200: {"content": {"application/zstd": {}}}}

    get, answer = app.get, partial(app.post, status_code=201, responses=UNAVAILABLE | MISSING | over)
    get("/advisories", response_model=AdvisoryList, responses=UNAVAILABLE)(routes.advisories)
    get("/advisories/{advisory_id}", response_model=RevisionList, responses=UNAVAILABLE | MISSING)(routes.advisory)
    answer("/advisories/{advisory_id}/acknowledgement", response_model=AnyRevision)(routes.acknowledge)
    get("/situations", response_model=SituationList, responses=UNAVAILABLE)(routes.situations)
    get("/situations/{situation_id}", response_model=SituationRevisions, responses=UNAVAILABLE | MISSING)(
        routes.situation
    )
    answer("/situations/{situation_id}/acknowledgement", response_model=Situation)(routes.acknowledge_situation)
    refused: Responses = {422: {"model": Reloaded, "description": "The file can't be used"}}
    app.post("/site/reload", response_model=Reloaded, responses=UNAVAILABLE | refused)(routes.reload)
    get("/robots", response_model=RobotList, responses=UNAVAILABLE)(routes.robots)
    get("/robots/{uuid}", response_model=HeardRobot, responses=UNAVAILABLE | MISSING)(routes.robot)
    app.post("/robots/{uuid}/owner", response_model=Owned, responses=UNAVAILABLE | over)(routes.give_robot)
    get("/vendors", response_model=VendorList, responses=UNAVAILABLE)(routes.vendors)
    get("/quarantine", response_model=QuarantineList, responses=UNAVAILABLE)(routes.quarantine)
    get("/blackboxes", response_model=BlackBoxList)(routes.blackboxes)
    get("/blackboxes/{file}", response_class=Response, responses=MISSING | zstd)(routes.blackbox)
    get("/healthz", response_model=ServiceHealth, responses=degraded)(routes.healthz)
    get("/metrics", response_class=Response, responses=text)(routes.metrics)
    get("/schema/advisory", response_model=Document)(routes.schema)
    get("/schema/situation", response_model=Document)(routes.situation_schema)


def _add_advice_routes(app: FastAPI, routes: AdviceRoutes) -> None:
    over: Responses = {409: {"description": "It has ended"}}
    app.get("/advice", response_model=AdviceList, responses=UNAVAILABLE)(routes.advice)
    app.get("/advice/{advice_id}", response_model=AdviceRevisions, responses=UNAVAILABLE | MISSING)(
        routes.advice_revisions
    )
    app.post(
        "/advice/{advice_id}/answer",
        response_model=RobotAdvice,
        status_code=201,
        responses=UNAVAILABLE | MISSING | over,
    )(routes.answer_advice)
    app.get("/schema/advice", response_model=Document)(routes.advice_schema)


def _add_sockets(app: FastAPI, publisher: Publisher, store: Store, sources: Sources) -> None:
    """Add the advisory stream, and the page with its live socket."""

    def send_timeout_s() -> float:
        return float(app.state.site.operator.stream_send_timeout_s)

    stream = AdvisoryStream(store, publisher, app.state.measures, send_timeout_s)

    @app.websocket("/advisories/stream")
    async def follow(websocket: WebSocket) -> None:
        await stream.serve(websocket)

    add_page_routes(app, publisher, store, sources, send_timeout_s)


def _add_descriptions(app: FastAPI) -> None:
    """Add the description of the API for programs, and its index for people."""

    @cache
    def openapi_json() -> bytes:
        return json.dumps(app.openapi()).encode()

    @app.get("/openapi.json", include_in_schema=False)
    async def openapi() -> Response:
        return Response(openapi_json(), media_type="application/json")

    @app.get("/api", include_in_schema=False)
    async def index() -> HTMLResponse:
        return HTMLResponse(_index(app))


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
<dt><code>/advisories/stream?after=SEQ&amp;kinds=KINDS</code></dt><dd>WebSocket: each revision as it is published.</dd>
<dt><code>/live</code></dt><dd>WebSocket: the floor as the page draws it.</dd>
<dt><code>{_linked("/openapi.json")}</code></dt><dd>The description of this interface.</dd></dl></html>
"""


def _linked(path: str) -> str:
    return escape(path) if "{" in path else f'<a href="{escape(path)}">{escape(path)}</a>'
