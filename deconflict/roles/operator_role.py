"""The operator face's process: stores what the engine decides, serves the API, the stream and the metrics."""

import asyncio
import json
import logging
import socket
import time
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from itertools import groupby
from pathlib import Path
from typing import Any

from deconflict.advisory import ADVISORY, Acknowledgement
from deconflict.engine.load_shedding import Effort
from deconflict.operator.blackbox.blackbox_request import Near
from deconflict.operator.blackbox.keeper import Keeper
from deconflict.operator.http.api import Exposition, SourceUnavailableError, create_app
from deconflict.operator.http.uvicorn_server import face_server
from deconflict.operator.live.history import BusyError, Past
from deconflict.operator.live.recent_batches import opened
from deconflict.operator.outlets.outlets import Outlets
from deconflict.operator.store.learned_file import LearnedFile
from deconflict.operator.store.publisher import StreamEndedError
from deconflict.operator.store.store import Store, StoreError
from deconflict.operator.vendor_health import vendor_health
from deconflict.runtime.first_of import until_either
from deconflict.runtime.rpc import AsyncCaller, LinkDownError, PortTakenError, listening, socket_path
from deconflict.settings.hot_reload import ASKED_FILE, InForce, reloads
from deconflict.settings.site import Site
from ingest.batch import Batch
from ingest.measures.measures import Measures, joined_values
from ingest.security.certificates import Certificates
from ingest.security.tokens import SecretError

log = logging.getLogger(__name__)

ENGINE_STALE_S = 5.0
"""An engine not heard from for this long counts as down; it reports every second."""
HEALTH_WITHIN_S = 3.0
"""A receiver that does not answer for this long counts as down."""
PRUNE_EVERY_S = 3600.0
REFRESH_EVERY_S = 5.0
CARRIED_WITHIN_S = 5.0
RELOAD_CHECK_S = 0.2
RELOAD_WITHIN_S = 10.0
ROLES_FILE = "roles.json"
"""What the supervisor says of its processes, in the runtime directory: `Watched.told` by role."""


NOBODY_SILENT: dict[str, Any] = {"fading": {}, "taken_off": {}, "exits": []}
"""What an engine tells of who is still there, before it has told anything."""


class OperatorRole:
    """Owns the store. Everything else it serves, it asks of the other roles when asked itself."""

    def __init__(self, site: Site, runtime: Path, data: Path, exposition: Exposition) -> None:
        self._site, self._runtime = site, runtime
        self._receiver = AsyncCaller(runtime, "follower" if site.cluster else "receiver")
        self._engine_measures: list[dict[str, Any]] = []
        self._engine_heard_s = float("-inf")
        self._still_there_told: dict[str, Any] = NOBODY_SILENT
        self.ready = asyncio.Event()
        """Set once its port is open."""
        self.port = 0
        self._certificates = Certificates(site.operator.tls) if site.operator.tls else None
        self._store = Store(data)
        self._anew = asyncio.Event()
        """Set where what is stored is not of the stream that is followed; then the role ends and begins anew."""
        self._app = create_app(self._store, self, exposition, site)
        if site.cluster:
            self._app.state.publisher.carry = self._carry
        self._learned_file = LearnedFile(data, self._app.state.measures)
        self._outlets = Outlets(self._store, self._app.state.publisher)
        self._past = Past(site, data / "log")
        self._keeper = Keeper(site, data, self._store, self._app.state.measures)

    async def run(self, stop: asyncio.Event) -> None:
        """Serve until `stop` is set."""
        calls = {
            "restore": self._restore,
            "learned": self._learned,
            "learn": self._learn,
            "unlearn": self._unlearn,
            "publish": self._publish,
            "stored": self._stored,
            "told": self._told,
            "begin_anew": self._begin_anew,
            "measures": self._measures,
            "health": self._health,
        }
        server, bound = face_server(self._app, self._certificates), self._bound()
        self.port = bound.getsockname()[1]
        async with listening(socket_path(self._runtime, "operator"), calls):
            serving = asyncio.create_task(server.serve([bound]))
            waiting = asyncio.create_task(until_either(stop.wait(), self._anew.wait()))
            self._outlets.renew(self._site.webhooks, self._site.mqtt)
            ours = (self._prune(), self._refresh(), self._renew(), self._keeper.run())
            chores = [asyncio.create_task(one) for one in ours]
            self.ready.set()
            try:
                await asyncio.wait({serving, waiting}, return_when=asyncio.FIRST_COMPLETED)
            finally:
                waiting.cancel()
                for chore in chores:
                    chore.cancel()
                await asyncio.gather(*chores, self._outlets.close(), return_exceptions=True)
                if self._anew.is_set():
                    self._app.state.publisher.end()
                server.should_exit = True
                await serving
                bound.close()
        self._past.close()
        await self._app.state.publisher.close()
        self._store.close()
        if self._anew.is_set():
            log.error("what was stored is kept as %s", self._store.set_aside(datetime.now(UTC)).name)

    def _bound(self) -> socket.socket:
        host, port = self._site.operator.host, self._site.operator.port
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            return socket.create_server((host, port), family=family)
        except OSError as error:
            raise PortTakenError("operator", host, port) from error

    async def robots(self) -> list[dict[str, Any]]:
        robots: list[dict[str, Any]] = await self._ask("robots")
        return [one | _still_there(one, self._still_there_told) for one in robots]

    def still_there(self) -> dict[str, Any]:
        return self._still_there_told

    async def quarantine(self) -> list[dict[str, Any]]:
        rejected: list[dict[str, Any]] = await self._ask("quarantine")
        return rejected

    async def measures(self) -> list[dict[str, Any]]:
        """The measures of every role that answers; what the others said last is left out."""
        receiver = await self._receiver_measures()
        up, own = await self._up(receiver is not None), Measures()
        own.level("deconflict_role_up", {(role,): float(alive) for role, alive in up.items()})
        for role, restarts in self._restarts().items():
            own.count("deconflict_role_restarts_total", role, by=restarts)
        if told := reloads(self._runtime):
            for result in ("applied", "refused"):
                own.count("deconflict_site_reloads_total", result, by=told[result])
        return [own.as_document(), *self._engine_measures, *(receiver or [])]

    async def health(self) -> dict[str, Any]:
        answers = not self._site.cluster and await self._receiver_measures() is not None
        up, told = await self._up(answers), reloads(self._runtime)
        return {
            "status": "ok" if all(up.values()) else "degraded",
            "roles": {role: "up" if alive else "down" for role, alive in up.items()},
            "restarts": self._restarts(),
            "effort": self._effort(),
            "site": {key: told[key] for key in ("problems", "needs_restart")} if told else {},
        }

    async def reload(self) -> dict[str, Any]:
        """Have the supervisor read the site file again, and wait for what becomes of it."""
        before = reloads(self._runtime)
        if before is None:
            raise SourceUnavailableError("supervisor")
        (self._runtime / ASKED_FILE).touch()
        with suppress(TimeoutError):
            async with asyncio.timeout(RELOAD_WITHIN_S):
                while True:
                    await asyncio.sleep(RELOAD_CHECK_S / 2)
                    told = reloads(self._runtime)
                    if told and told["applied"] + told["refused"] > before["applied"] + before["refused"]:
                        return told | {"applied": not told["problems"]}
        raise SourceUnavailableError("supervisor")

    async def follow(self, number: int) -> tuple[int, bool, Batch | None]:
        return opened(await self._receiver.call("follow", str(number).encode()))

    async def pulse(self) -> dict[str, Any]:
        """Roles, vendors, and the robots that are unidentified as far as the receiver answers; and of the silent ones
        how likely each is still there, and which are not, with when they were heard last."""
        receiver, documents, unidentified = await self._receiver_measures(), self._engine_measures, []
        roles = await self._up(receiver is not None)
        if receiver is not None:
            documents = [*documents, *receiver]
            with suppress(SourceUnavailableError):
                unidentified = await self._ask("unidentified")
        return {
            "roles": {role: "up" if alive else "down" for role, alive in roles.items()},
            "vendors": {one.name: one.model_dump(mode="json", exclude={"name"}) for one in vendor_health(documents)},
            "effort": self._effort(),
            "unidentified": unidentified,
            "fading": self._still_there_told["fading"],
            "taken_off": {uuid: one["heard_s"] for uuid, one in self._still_there_told["taken_off"].items()},
        }

    def blackboxes(self) -> list[dict[str, Any]]:
        return self._keeper.shelf.boxes()

    def blackbox(self, file: str) -> Path | None:
        return self._keeper.shelf.path(file)

    def recorded(self) -> tuple[float, float] | None:
        return self._past.recorded()

    async def floor_at(self, at_s: float) -> str:
        try:
            return await self._past.floor_at(at_s)
        except BusyError as error:
            raise SourceUnavailableError("recording") from error

    async def _receiver_measures(self) -> list[dict[str, Any]] | None:
        """None where no receiver answers; who asks for health does not wait as long as others."""
        try:
            told: list[dict[str, Any]] = json.loads(await self._receiver.call("measures", within_s=HEALTH_WITHIN_S))
        except LinkDownError:
            return None
        return told

    async def _up(self, receiver: bool) -> dict[str, bool]:
        """Which roles are up, given whether the receiver answers; of a cluster whether there is one of each."""
        engine = time.monotonic() - self._engine_heard_s < ENGINE_STALE_S
        before = await self._presence() if self._site.cluster else {"receiver": receiver}
        return before | {"engine": engine and self._engine_runs(), "operator": True}

    async def _presence(self) -> dict[str, bool]:
        """Whether the NATS servers of a cluster are in touch, and an ingest is; as the follower beside this says."""
        try:
            told: dict[str, bool] = json.loads(await self._receiver.call("presence", within_s=HEALTH_WITHIN_S))
        except LinkDownError:
            return {"nats": False, "ingest": False}
        return told

    async def _silent(self) -> str:
        """What to name where a question has no answer."""
        if not self._site.cluster:
            return "receiver"
        there = await self._presence()
        if not there["nats"]:
            return "NATS server"
        return "follower" if there["ingest"] else "ingest"

    def _effort(self) -> str:
        """What the engine works out, as far as it is known: an `Effort` in lower case."""
        told = joined_values(self._engine_measures).get("deconflict_engine_effort_reduced", {})
        return Effort(int(told.get((), Effort.FULL))).name.lower()

    def _engine_runs(self) -> bool:
        """Whether the engine that was heard is the one that runs, as far as a supervisor says."""
        told = self._supervised().get("engine")
        if told is None:
            return True
        since_s = told["since_s"]
        return since_s is not None and self._engine_heard_s >= since_s

    async def _ask(self, name: str) -> Any:
        try:
            return json.loads(await self._receiver.call(name))
        except LinkDownError as error:
            raise SourceUnavailableError(await self._silent()) from error

    def _restarts(self) -> dict[str, int]:
        return {role: told["restarts"] for role, told in self._supervised().items()}

    def _supervised(self) -> dict[str, dict[str, Any]]:
        path = self._runtime / ROLES_FILE
        supervised: dict[str, dict[str, Any]] = json.loads(path.read_text()) if path.exists() else {}
        return supervised

    async def _prune(self) -> None:
        """Forget advisories that were cleared long ago, now and every hour."""
        while True:
            before = datetime.now(UTC) - timedelta(days=self._site.store.keep_days)
            try:
                forgotten = await asyncio.to_thread(self._store.prune, before)
            except StoreError as error:
                log.warning("old advisories can't be removed: %s", error)
            else:
                if forgotten:
                    log.info("%s advisories cleared before %s are forgotten", forgotten, before)
            await asyncio.sleep(PRUNE_EVERY_S)

    async def _refresh(self) -> None:
        """Take up tokens and certificates that have changed, and try a disk again that failed."""
        while True:
            await asyncio.sleep(REFRESH_EVERY_S)
            if self._store.waits:
                await self._app.state.publisher.settle()
            self._app.state.people.refresh()
            self._outlets.refresh()
            if self._certificates:
                self._certificates.refresh()

    async def _renew(self) -> None:
        """Take up changed settings as soon as they are in force."""
        in_force = InForce(self._runtime, self._site)
        while True:
            if site := in_force.changed():
                try:
                    self._app.state.people.renew(site.operator.people)
                except SecretError as error:
                    log.error("operator.people stay as they were: %s", error)
                try:
                    self._outlets.renew(site.webhooks, site.mqtt)
                except SecretError as error:
                    log.error("webhooks and mqtt stay as they were: %s", error)
                self._site = self._app.state.site = self._past.site = self._keeper.site = site
            await asyncio.sleep(RELOAD_CHECK_S)

    async def _restore(self, _: bytes) -> bytes:
        """What an engine needs to go on where the last one stopped."""
        stored = {
            "open": [one.model_dump(mode="json") for one in self._store.open()],
            "burdens_s": self._store.burdens_s(),
            "encounters": [[*pair, count] for pair, count in self._store.encounters().items()],
        }
        return json.dumps(stored).encode()

    async def _stored(self, _: bytes) -> bytes:
        """Up to where a stream that is followed is stored: a `Seen`."""
        seq = self._store.last_seq()
        last = next(iter(self._store.after(seq - 1, 1)), None) if seq else None
        return json.dumps([seq, last.id, last.revision] if last else [seq, "", 0]).encode()

    async def _begin_anew(self, _: bytes) -> bytes:
        """Set aside what is stored, which is not of the stream that is followed, and end; the supervisor goes on."""
        self._anew.set()
        return b"set aside"

    async def _told(self, payload: bytes) -> bytes:
        """Store what a stream tells, in its order and under its numbers."""
        publisher = self._app.state.publisher
        for is_answer, lines in groupby(json.loads(payload), lambda line: "answer" in line):
            if is_answer:
                for line in lines:
                    answer = Acknowledgement.model_validate(line["answer"])
                    await publisher.answered(line["id"], answer, line["seq"])
            else:
                told = [ADVISORY.validate_python(line["advisory"] | {"seq": line["seq"]}) for line in lines]
                await publisher.publish(told)
        return b"stored"

    async def _carry(self, advisory_id: str, answer: Acknowledgement) -> None:
        """Have the follower tell an answer to the stream, and wait until it comes back."""
        payload = json.dumps({"id": advisory_id, "answer": answer.model_dump(mode="json")}).encode()
        try:
            seq = json.loads(await AsyncCaller(self._runtime, "follower").call("answer", payload))["seq"]
            async with asyncio.timeout(CARRIED_WITHIN_S):
                await self._app.state.publisher.reached(seq)
        except (LinkDownError, TimeoutError, StreamEndedError) as error:
            raise SourceUnavailableError("follower") from error
        if not seq:
            raise SourceUnavailableError("NATS server")

    async def _learned(self, _: bytes) -> bytes:
        """What an engine that begins goes on with."""
        learned = await asyncio.to_thread(self._learned_file.read)
        await asyncio.to_thread(self._keeper.begun, learned)
        return learned

    async def _learn(self, learned: bytes) -> bytes:
        await asyncio.to_thread(self._learned_file.write, learned)
        await asyncio.to_thread(self._keeper.learned, learned)
        return b"kept"

    async def _unlearn(self, why: bytes) -> bytes:
        await asyncio.to_thread(self._learned_file.set_aside, why.decode())
        await asyncio.to_thread(self._keeper.begun, b"")
        return b"set aside"

    async def _measures(self, _: bytes) -> bytes:
        return json.dumps([*await self.measures(), self._app.state.measures.as_document()]).encode()

    async def _health(self, _: bytes) -> bytes:
        return json.dumps(await self.health()).encode()

    async def _publish(self, payload: bytes) -> bytes:
        parcel = json.loads(payload)
        self._engine_heard_s = time.monotonic()
        self._engine_measures = parcel["measures"] or self._engine_measures
        self._still_there_told = parcel.get("presence") or self._still_there_told
        if parcel["advisories"]:
            advisories = [ADVISORY.validate_python(one) for one in parcel["advisories"]]
            await self._app.state.publisher.publish(advisories)
        if parcel["near_misses"]:
            await asyncio.to_thread(self._keeper.note, [Near.told(*one) for one in parcel["near_misses"]])
        return b"stored"


def _still_there(robot: dict[str, Any], presence: dict[str, Any]) -> dict[str, Any]:
    """What a robot's document says besides: how likely it is still there, and by whom it was found not to be."""
    off = presence["taken_off"].get(robot["uuid"])
    there = 0.0 if off else presence["fading"].get(robot["uuid"], 1.0)
    return {"still_there": there, "taken_off": off and {"at_s": off["at_s"], "by": off["by"]}}
