"""The handlers of the HTTP API: situations, advisories, robots, vendors, black boxes, health and metrics."""

import asyncio
from datetime import UTC, datetime, timedelta
from functools import partial
from typing import Annotated
from uuid import UUID

from fastapi import HTTPException, Query, Request, Response
from fastapi.responses import FileResponse
from pydantic_core import to_json

from deconflict.operator.http.access import People
from deconflict.operator.http.api_sources import Exposition, Sources, SourceUnavailableError
from deconflict.operator.http.filter_names import NamesInFilters
from deconflict.operator.http.json_schemas import SCHEMAS
from deconflict.operator.store.listings import StateFilter
from deconflict.operator.store.publisher import PRUNED, Publisher
from deconflict.operator.store.store import Store, StoreError
from deconflict.operator.store.tables import STUCK
from deconflict.operator.vendor_health import vendor_health
from deconflict_client.advisory import (
    ADVICE,
    SITUATION,
    Acknowledgement,
    AdvisoryState,
    RevisionKind,
    Severity,
    SituationKind,
)
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.answers.api_models import (
    AdviceList,
    AdviceRevisions,
    AdvisoryList,
    Answer,
    NewOwner,
    Owned,
    Problem,
    RefusedRequest,
    Reloaded,
    RevisionList,
    SituationList,
    SituationRevisions,
    VendorAnswer,
)
from deconflict_client.answers.vendor_models import VendorList
from deconflict_client.situations import advice_of, most_urgent_first, situations_of
from ingest.measures.measures import Measures

MOST_LISTED = 10_000
"""A floor with 10,000 robots may have a few thousand open advisories. A subscriber needs them all to begin with."""
RENEWAL_SHOWN = timedelta(minutes=10)
STORE_TIMEOUT_S = 1.0
"""Health waits for the disk no longer."""
"""A database that was begun anew is reported as degraded for this long."""


class ApiRoutes:
    """One method for each route."""

    def __init__(
        self,
        publisher: Publisher,
        store: Store,
        sources: Sources,
        names: NamesInFilters,
        exposition: Exposition,
        measures: Measures,
    ) -> None:
        self._publisher, self._store, self._sources, self._exposition = publisher, store, sources, exposition
        self._names, self._measures = names, measures
        self._reading: asyncio.Task[tuple[int, int]] | None = None
        """The newest question of health to the store."""

    def advisories(
        self,
        state: Annotated[StateFilter, Query(description="only advisories in this state")] = "open",
        kind: Annotated[RevisionKind | None, Query(description="only advisories of this kind, or situations")] = None,
        vendor: Annotated[str | None, Query(description="only advisories with a robot of this vendor")] = None,
        robot: Annotated[str | None, Query(description="only advisories with this robot (UUID)")] = None,
        limit: Annotated[int, Query(ge=1, le=MOST_LISTED, description="largest number of advisories")] = 100,
    ) -> Response:
        """The newest revision of each advisory, newest first. Situations are listed only if asked for."""
        party = {"vendor": vendor, "robot": robot and robot.lower()}
        listing = self._store.latest(state, kind=kind, limit=limit, **party)
        unknown = {} if listing.advisories else self._names.unknown_from_thread(**party)
        return json_response(
            AdvisoryList(seq=listing.seq, advisories=listing.advisories, more=listing.more, unknown=unknown)
        )

    def advisory(self, advisory_id: str) -> Response:
        """Every revision of one advisory."""
        revisions = self._store.get(advisory_id)
        if not revisions:
            raise self._not_found("advisory", advisory_id)
        return json_response(RevisionList(advisories=revisions))

    def situations(
        self,
        state: Annotated[StateFilter, Query(description="only situations in this state")] = "open",
        kind: Annotated[SituationKind | None, Query(description="only situations of this `situation_kind`")] = None,
        severity: Annotated[Severity | None, Query(description="only situations of this severity")] = None,
        vendor: Annotated[str | None, Query(description="only situations with a robot of this vendor")] = None,
        robot: Annotated[str | None, Query(description="only situations with this robot (UUID)")] = None,
        limit: Annotated[int, Query(ge=1, le=MOST_LISTED, description="largest number of situations")] = 100,
    ) -> Response:
        """The newest revision of each situation: open ones in their `order`, the most urgent first; others newest
        first."""
        party, is_open = {"vendor": vendor, "robot": robot and robot.lower()}, state == "open"
        most = MOST_LISTED if is_open else limit
        listing = self._store.latest(state, kind=SITUATION, situation_kind=kind, severity=severity, limit=most, **party)
        found = situations_of(listing.advisories)
        situations = most_urgent_first(found)[:limit] if is_open else found
        unknown = {} if situations else self._names.unknown_from_thread(**party)
        more = listing.more or len(found) > limit
        return json_response(SituationList(seq=listing.seq, situations=situations, more=more, unknown=unknown))

    def situation(self, situation_id: str) -> Response:
        """Every revision of one situation."""
        revisions = situations_of(self._store.get(situation_id))
        if not revisions:
            raise self._not_found("situation", situation_id)
        return json_response(SituationRevisions(situations=revisions))

    async def acknowledge(self, advisory_id: str, answer: Answer, request: Request) -> Response:
        """Acknowledge an advisory by name and with a reason. Everybody sees it, and the stream sends it."""
        name = getattr(request.state, "person", None) or answer.name
        if not name:
            raise HTTPException(422, "name: is empty; expected who acknowledges")
        revisions = await asyncio.to_thread(self._store.get, advisory_id)
        if advice_of(revisions):
            raise HTTPException(409, f"{advisory_id!r} is advice; POST /advice/{advisory_id}/answer answers it")
        if revisions and revisions[-1].state is AdvisoryState.CLEARED:
            raise HTTPException(409, f"{advisory_id!r} is cleared; only what is open can be acknowledged")
        summary = (revisions[-1].headline or revisions[-1].summary) if revisions else ""
        acknowledgement = Acknowledgement(name=name, reason=answer.reason, at=datetime.now(UTC), summary=summary)
        answered = await self._publisher.acknowledge(advisory_id, acknowledgement)
        if answered is None:
            raise self._not_found("advisory", advisory_id)
        return json_response(answered, 201)

    async def acknowledge_situation(self, situation_id: str, answer: Answer, request: Request) -> Response:
        """Acknowledge a situation by name and with a reason. Everybody sees it, and the stream sends it."""
        if not situations_of(await asyncio.to_thread(self._store.get, situation_id)):
            raise self._not_found("situation", situation_id)
        return await self.acknowledge(situation_id, answer, request)

    def _not_found(self, what: str, wanted_id: str) -> Exception:
        if self._store.outage:
            return StoreError(f"no {what} {wanted_id!r} is known while older ones can't be read: {self._store.outage}")
        return HTTPException(404, f"no {what} {wanted_id!r} is stored; cleared ones are removed in time")

    async def robots(
        self, vendor: Annotated[str | None, Query(description="only robots of this vendor")] = None
    ) -> Response:
        """What each robot reported, and how the service reads it."""
        robots = [robot for robot in await self._sources.robots() if vendor in (None, robot["vendor"])]
        unknown = {} if robots else await self._names.unknown(vendor=vendor)
        return json_response({"robots": robots} | ({"unknown": unknown} if unknown else {}))

    async def robot(self, uuid: str) -> Response:
        """What one robot reported."""
        for robot in await self._sources.robots(uuid.lower()):
            if robot["uuid"] == uuid.lower():
                return json_response(robot)
        raise HTTPException(404, f"no robot {uuid!r} has reported")

    async def give_robot(self, uuid: UUID, owner: NewOwner) -> Response:
        """Let a robot belong to a vendor from now on. Reports of it from other vendors are refused."""
        given = await self._sources.give_robot(str(uuid), owner.vendor)
        if given["problem"]:
            raise HTTPException(409, given["problem"])
        return json_response(Owned(uuid=str(uuid), vendor=owner.vendor, before=given["before"]))

    async def vendors(self) -> Response:
        """The state of each vendor: its robots, messages, clocks, forecasts and grade, what changed, what to mend."""
        measures, senders = await self._sources.measures(), await self._sources.senders()
        return json_response(VendorList(vendors=vendor_health(measures, senders)))

    async def quarantine(self) -> Response:
        """Rejected messages, each with its rule and reason."""
        return json_response({"rejected": await self._sources.quarantine()})

    def blackboxes(self) -> Response:
        """Near misses, each with the file of what was received and decided around it."""
        return json_response({"blackboxes": self._sources.blackboxes()})

    def blackbox(self, file: str) -> Response:
        """One black box: JSON lines, compressed with zstd. `deconflict blackbox verify` checks it."""
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
            seq, used_bytes = await self._read_store()
            stored = {"status": "ok", "seq": seq, "bytes": used_bytes}
            if pruned := self._publisher.measures.values[PRUNED].get(("size",)):
                stored["pruned_for_size"] = int(pruned)
            if renewal := self._store.connections.renewal:
                stored |= {
                    "set_aside": renewal.file or None,
                    "copied": renewal.salvage.copied,
                    "lost": renewal.salvage.lost,
                }
                if datetime.now(UTC) - renewal.at < RENEWAL_SHOWN:
                    stored |= {"status": "begun anew", "reason": str(renewal)}
            if self._store.outage:
                stored |= {"status": "in memory", "reason": self._store.outage}
            if self._publisher.failing:
                unstored = {"reason": self._publisher.failing, "unstored": self._store.unstored}
                stored |= {"status": "failing", **unstored}
        except StoreError as error:
            stored = {"status": "failing", "reason": str(error)}
        if stored["status"] != "ok":
            health = health | {"status": "degraded"}
        return json_response(health | {"store": stored}, 200 if health["status"] == "ok" else 503)

    async def _read_store(self) -> tuple[int, int]:
        """The last number, and the size of the file. Raises `StoreError` also if the disk does not answer soon: one
        question waits for it, and nothing else does."""
        if self._reading is None or self._reading.done():
            ask = partial(lambda store: (store.last_seq(), store.used_bytes()), self._store)
            self._reading = asyncio.create_task(asyncio.to_thread(ask))
        await asyncio.wait({self._reading}, timeout=STORE_TIMEOUT_S)
        if not self._reading.done():
            raise StoreError(self._store.outage or f"{self._store.path}: {STUCK}")
        return await self._reading

    async def reload(self) -> Response:
        """Read the site file again and apply what has changed; 422 if the file is refused."""
        result = Reloaded.model_validate(await self._sources.reload())
        result.detail = "; ".join(result.problems)
        return json_response(result, 200 if result.applied else 422)

    async def metrics(self) -> Response:
        """Prometheus text, without the metrics of roles that do not answer."""
        try:
            documents = await self._sources.measures()
        except SourceUnavailableError as error:
            down = Measures()
            down.level("deconflict_role_up", {(error.role,): 0})
            documents = [down.as_document()]
        own = [self._publisher.measures.as_document(), self._measures.as_document()]
        body, content_type = self._exposition([*documents, *own])
        return Response(body, headers={"content-type": content_type})

    def schema(self) -> Response:
        """JSON Schema of an advisory."""
        return json_response(SCHEMAS["advisory"](), media_type="application/schema+json")

    def situation_schema(self) -> Response:
        """JSON Schema of a situation."""
        return json_response(SCHEMAS["situation"](), media_type="application/schema+json")


class AdviceRoutes:
    """One method for each route."""

    def __init__(self, publisher: Publisher, store: Store, names: NamesInFilters, people: People) -> None:
        self._publisher, self._store, self._names, self._people = publisher, store, names, people

    def advice(
        self,
        state: Annotated[StateFilter, Query(description="only advice in this state")] = "open",
        vendor: Annotated[str | None, Query(description="only advice with a robot of this vendor")] = None,
        robot: Annotated[str | None, Query(description="only advice with this robot (UUID)")] = None,
        limit: Annotated[int, Query(ge=1, le=MOST_LISTED, description="largest number of pieces of advice")] = 100,
    ) -> Response:
        """What is asked of robots now, newest first: the newest revision of each piece of advice."""
        party = {"vendor": vendor, "robot": robot and robot.lower()}
        listing = self._store.latest(state, kind=ADVICE, limit=limit, **party)
        advice = advice_of(listing.advisories)
        unknown = {} if advice else self._names.unknown_from_thread(**party)
        return json_response(AdviceList(seq=listing.seq, advice=advice, more=listing.more, unknown=unknown))

    def advice_revisions(self, advice_id: str) -> Response:
        """Every revision of one piece of advice."""
        return json_response(AdviceRevisions(advice=self._revisions(advice_id)))

    async def answer_advice(self, advice_id: str, answer: VendorAnswer, request: Request) -> Response:
        """Answer advice for a robot: accepted, declined and why, or done. Only the vendor that is asked may."""
        advice = (await asyncio.to_thread(self._revisions, advice_id))[-1]
        person = getattr(request.state, "person", None)
        self._check_vendor(person, advice)
        if not (name := person or answer.name):
            raise HTTPException(422, "name: is empty; expected who answers")
        if advice.state is AdvisoryState.CLEARED:
            raise HTTPException(409, f"{advice_id!r} has ended: {advice.cleared_because}")
        before = advice.acknowledgement and advice.acknowledgement.answer
        if before == answer.answer:
            return json_response(advice, 201)
        if before and answer.answer != "done":
            raise HTTPException(409, f"{advice_id!r} was answered already: {before}; only 'done' may follow")
        given = Acknowledgement(
            name=name, reason=answer.why, at=datetime.now(UTC), summary=advice.summary, answer=answer.answer
        )
        return json_response(await self._publisher.acknowledge(advice_id, given), 201)

    def advice_schema(self) -> Response:
        """JSON Schema of advice."""
        return json_response(SCHEMAS["advice"](), media_type="application/schema+json")

    def _revisions(self, advice_id: str) -> list[RobotAdvice]:
        """Raises `HTTPException` if there are none."""
        if found := advice_of(self._store.get(advice_id)):
            return found
        raise HTTPException(404, f"no advice {advice_id!r} is stored; ended advice is removed in time")

    def _check_vendor(self, person: str | None, advice: RobotAdvice) -> None:
        vendor = self._people.vendor(person) if person else None
        if vendor is not None and vendor != advice.vendor:
            raise HTTPException(403, f"{person} answers for {vendor}; this was asked of {advice.vendor}")


def json_response(content: object, status: int = 200, media_type: str = "application/json") -> Response:
    """Infinite numbers and NaN become null."""
    return Response(to_json(content, inf_nan_mode="null"), status, media_type=media_type)


async def source_unavailable(_: Request, error: Exception) -> Response:
    role = error.role if isinstance(error, SourceUnavailableError) else "unknown"
    return json_response(Problem(detail=f"{error}; try again shortly, or see /healthz", role=role), 503)


async def failed(_: Request, __: Exception) -> Response:
    """The answer to a request at which the service itself failed. The log has the error."""
    return json_response(RefusedRequest(detail="the service failed at this request; its log says why"), 500)


async def store_failed(_: Request, error: Exception) -> Response:
    return json_response(Problem(detail=str(error), role="store"), 503)
