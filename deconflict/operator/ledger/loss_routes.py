"""`GET /losses`: how much time robots lost, by any of the keys, over any span."""

import json
import time
from collections.abc import Awaitable, Callable
from typing import Annotated, Literal, Protocol, cast, get_args

from fastapi import FastAPI, HTTPException, Query, Response
from pydantic_core import to_json

from deconflict.foresight.losses.loss import LossKind
from deconflict.operator.ledger.loss_csv import as_csv
from deconflict.operator.ledger.loss_questions import DAY_S, LossQuestion
from deconflict_client.answers.loss_models import LossKey, LossList

KEYS = get_args(LossKey)
MOST_ROWS = 10_000


Ask = Callable[[LossQuestion], Awaitable[LossList]]
UNKNOWN = "deconflict-unknown"
"""Header of a table as CSV, which has no other room for `LossList.unknown`."""


class Unknown(Protocol):
    """By parameter of a filter, a sentence if nobody known has that name."""

    def __call__(self, *, vendor: str | None, by: str | None, place: str | None) -> Awaitable[dict[str, str]]: ...


def add_loss_routes(app: FastAPI, ask: Ask, unknown: Unknown) -> None:
    @app.get("/losses", response_model=LossList, responses={200: {"content": {"text/csv": {}}}})
    async def losses(
        group: Annotated[
            str, Query(description=f"keys to sum by, separated by commas: {', '.join(KEYS)}")
        ] = "vendor,by",
        from_s: Annotated[
            float | None, Query(ge=0, allow_inf_nan=False, description="seconds since the epoch; a day ago if absent")
        ] = None,
        until_s: Annotated[float | None, Query(ge=0, allow_inf_nan=False, description="now if absent")] = None,
        vendor: Annotated[str | None, Query(description="only time that robots of this vendor lost")] = None,
        by: Annotated[str | None, Query(description="only time lost to robots of this vendor")] = None,
        kind: Annotated[LossKind | None, Query(description="only losses of this kind")] = None,
        place: Annotated[str | None, Query(description="only losses that began in this place")] = None,
        limit: Annotated[int, Query(ge=1, le=MOST_ROWS, description="largest number of rows")] = 1000,
        table: Annotated[
            Literal["json", "csv"], Query(alias="format", description="JSON, or the rows as CSV")
        ] = "json",
    ) -> Response:
        """How much time robots lost to each other, in whole hours, by any of the keys."""
        end_s = time.time() if until_s is None else until_s
        begin_s = end_s - DAY_S if from_s is None else from_s
        question = LossQuestion(begin_s, end_s, loss_keys(group), vendor, by, kind and kind.value, place, limit)
        found = await ask(question)
        if not (found.total.losses or found.total.refusals or found.total.unable):
            found.unknown = await unknown(vendor=vendor, by=by, place=place)
        if table == "csv":
            headers = {UNKNOWN: json.dumps(found.unknown)} if found.unknown else {}
            return Response(as_csv(question, found), headers=headers, media_type="text/csv; charset=utf-8")
        return Response(to_json(found), media_type="application/json")


def loss_keys(text: str) -> tuple[LossKey, ...]:
    """The keys of a list that is separated by commas. Raises `HTTPException`."""
    keys = tuple(dict.fromkeys(key.strip() for key in text.split(",") if key.strip()))
    if unknown := [key for key in keys if key not in KEYS]:
        raise HTTPException(422, f"group: {unknown[0]!r} is no key; expected any of {', '.join(KEYS)}")
    return cast(tuple[LossKey, ...], keys)
