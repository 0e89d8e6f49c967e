"""`POST /robots/{uuid}/off-floor`: an operator says that a robot is off the floor, or puts it back on it."""

from typing import Any
from uuid import UUID

from fastapi import FastAPI, HTTPException, Request, Response
from pydantic_core import to_json

from deconflict.operator.http.api_sources import Sources
from deconflict_client.answers.api_models import OffFloorState, OffFloorStatement
from ingest.recording.operator_events import OffFloorMark

NOWHERE: dict[int | str, dict[str, Any]] = {409: {"description": "It has sent no position, so it is on no floor"}}


def add_off_floor_routes(app: FastAPI, sources: Sources, responses: dict[int | str, dict[str, Any]]) -> None:
    """`responses` are those of all routes of robots."""

    @app.post("/robots/{uuid}/off-floor", response_model=OffFloorState, responses=responses | NOWHERE)
    async def off_floor(uuid: UUID, statement: OffFloorStatement, request: Request) -> Response:
        """Say that a robot is off the floor, until it is heard elsewhere; or put it back on the floor."""
        name = getattr(request.state, "person", None) or statement.name
        if not name:
            raise HTTPException(422, "name: is empty; expected who says so")
        mark = OffFloorMark(str(uuid), 0.0, statement.off_floor, name)
        if statement.off_floor:
            mark = _placed(mark, await sources.robots(str(uuid)))
        held = await sources.mark_off_floor(mark)
        state = OffFloorState(uuid=str(uuid), off_floor=bool(held), by=held.get("by"), at_s=held.get("at_s"))
        return Response(to_json(state), media_type="application/json")


def _placed(mark: OffFloorMark, robots: list[dict[str, Any]]) -> OffFloorMark:
    """A mark with the place where the robot was last. Raises `HTTPException` for a robot that was nowhere."""
    robot = next((robot for robot in robots if robot["uuid"] == mark.uuid), None)
    if robot is None:
        raise HTTPException(404, f"no robot {mark.uuid!r} has reported")
    if not (place := robot.get("location")):
        raise HTTPException(409, f"{robot['name']} has sent no position, so it is on no floor")
    datum = robot["floor"] if robot["comparable"] else ""
    return OffFloorMark(mark.uuid, mark.at_s, mark.is_off, mark.by, datum, place["x"], place["y"])
