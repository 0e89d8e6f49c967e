"""What the HTTP API shows of the other roles: robots, measures, health, black boxes and the recorded floor."""

import asyncio
import json
import sqlite3
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec

from deconflict.cluster.members_health import SILENT_FOLLOWER, health_part, unknown_members
from deconflict.engine.load_shedding import Effort
from deconflict.operator.blackbox.archive import FOLDER, Archive
from deconflict.operator.http.api_sources import SourceUnavailableError
from deconflict.operator.ledger.loss_ledger import FILE_NAME as LOSSES
from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict.operator.ledger.optional_ledger import OptionalLedger
from deconflict.operator.live.history import BusyError, History, floor_at
from deconflict.operator.live.recent_batches import unpacked_batch
from deconflict.operator.store.store import StoreError
from deconflict.operator.vendor_health import vendor_health
from deconflict.roles.health.admission_health import admission_document, off_floor_document, pairs_document
from deconflict.roles.health.canary_health import LATENCY, CanaryHealth
from deconflict.roles.health.certificate_health import EXPIRES, CertificateHealth
from deconflict.roles.health.clock_health import ClockHealth
from deconflict.roles.health.delivery_health import DELAY, DeliveryHealth
from deconflict.roles.health.file_health import FileHealth, data_files
from deconflict.roles.health.positions_health import broker_notes, brokers_document, positions_document
from deconflict.roles.health.recording_health import RecordingHealth
from deconflict.roles.health.refusal_health import RefusalHealth
from deconflict.roles.role_files import (
    RoleProcesses,
    is_up,
    preparation,
    restarts,
    role_processes,
    stands_alone,
    supervisor_health,
)
from deconflict.runtime.rpc import AsyncCaller, LinkDownError
from deconflict.settings.hot_reload import REQUEST_FILE, reload_results
from deconflict.settings.site import Site
from deconflict_client.answers.loss_models import LossList
from ingest.batch import Batch
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.measures.measures import Measures, joined_values
from ingest.recording.operator_events import OffFloorMark

HEALTH_TIMEOUT_S = 3.0
"""A receiver that does not answer for this long counts as down."""
LIVE_QUESTIONS = "unidentified", "senders", "brokers", "off_floor"
"""Questions to the receiver for the page; each answer is a list."""
REFUSALS_EVERY_S = 5.0
MEMBERS = {"deconflict_members": "there", "deconflict_members_expected": "expected"}
"""By metric, the key of the part `members` of the health."""
PAST_TIMEOUT_S = 20.0
"""A follower that does not answer for this long has no past; an ingest has less time."""
RELOAD_CHECK_S = 0.1
ALONE = (
    "No NATS server is connected: you see and are warned of the robots of this machine only, without queues, deadlocks "
    "and other machines. See to the NATS servers and the network."
)
RELOAD_TIMEOUT_S = 10.0


@dataclass(slots=True, eq=False)
class EngineReport:
    """The last report of the engine."""

    canary: CanaryHealth
    received_s: float = float("-inf")
    """When it came, monotonic time."""
    measures: list[dict[str, Any]] = field(default_factory=list)
    presence: dict[str, Any] = field(
        default_factory=lambda: {"fading": {}, "taken_off": {}, "exits": [], "distrusted": []}
    )
    """`Presence.document`: which silent robots are still there."""
    delivery: DeliveryHealth = field(default_factory=DeliveryHealth)


class OperatorSources:
    """The `Sources` of the API. Asks the other roles at each request."""

    def __init__(self, site: Site, runtime: Path, data: Path, engine: EngineReport, ledger: OptionalLedger) -> None:
        self._is_cluster, self._runtime, self._engine = bool(site.cluster), runtime, engine
        self._receiver = AsyncCaller(runtime, "follower" if site.cluster else "receiver")
        self._ledger = ledger
        self._archive = Archive(data / FOLDER)
        self.history = History(site, data / "log")
        self.is_alone = stands_alone(runtime)
        """Whether it takes decisions from the engine of this machine alone."""
        self.notice = ALONE if self.is_alone else ""
        """A sentence for people that the page shows."""
        self._recording = RecordingHealth()
        self.files = FileHealth(data_files(site, data), gives_numbers=not site.cluster)
        self.certificates, self.clock = CertificateHealth(), ClockHealth(data)
        is_first = not site.cluster and not restarts(role_processes(runtime)).get("operator")
        self._refusals = RefusalHealth(since_start=is_first, looked_s=time.monotonic())

    async def robots(self, uuid: str = "") -> list[dict[str, Any]]:
        robots: list[dict[str, Any]] = await self._ask("robots", uuid.encode())
        return [robot | _presence_of(robot["uuid"], self._engine.presence) for robot in robots]

    async def give_robot(self, uuid: str, vendor: str) -> dict[str, Any]:
        problem = VendorRegistry(self.history.site.vendors).problem_of_giving(uuid, vendor)
        if self._is_cluster and problem:  # an ingest that is down can't say it
            return {"before": None, "problem": problem}
        return dict(await self._ask("give_robot", json.dumps([uuid, vendor]).encode()))

    async def mark_off_floor(self, mark: OffFloorMark) -> dict[str, Any]:
        return dict(await self._ask("mark_off_floor", msgspec.json.encode(mark)) or {})

    def presence(self) -> dict[str, Any]:
        return self._engine.presence

    async def quarantine(self) -> list[dict[str, Any]]:
        return await self._ask("quarantine")

    async def senders(self) -> list[dict[str, Any]]:
        return await self._listed("senders")

    async def _listed(self, question: str) -> list[dict[str, Any]]:
        """The receiver's answer; nothing if it does not answer."""
        answer: list[dict[str, Any]] = []
        with suppress(SourceUnavailableError):
            answer = await self._ask(question)
        return answer

    async def measures(self) -> list[dict[str, Any]]:
        """The measures of every role that answers. Old measures of the others are left out."""
        receiver = await self._receiver_measures()
        processes, members, own = role_processes(self._runtime), await self._members(), Measures()
        up = await self._roles_up(receiver is not None, processes)
        own.level("deconflict_role_up", {(role,): float(alive) for role, alive in up.items()})
        own.level(DELAY, {(): self._engine.delivery.delay_s(time.monotonic())})
        ends = self.certificates.expiry_s(self.history.site)
        own.level(EXPIRES, {(key,): end_s for key, end_s in ends.items()})
        for name, key in MEMBERS.items():
            own.level(name, {(part,): float(count) for part, count in members.get(key, {}).items()})
        if not self.is_alone:
            own.level(LATENCY, {(): self._engine.canary.latency_s(time.monotonic())})
        for role, count in restarts(processes).items():
            own.count("deconflict_role_restarts_total", role, by=count)
        if results := reload_results(self._runtime):
            for result in ("applied", "refused"):
                own.count("deconflict_site_reloads_total", result, by=results[result])
        return [own.as_document(), *self._engine.measures, *(receiver or [])]

    async def health(self) -> dict[str, Any]:
        receiver = await self._receiver_measures()
        processes, results = role_processes(self._runtime), reload_results(self._runtime)
        up = await self._roles_up(receiver is not None, processes)
        if receiver is not None:
            self._recording.note_measures(receiver)
        brokers, off_floor = [await self._listed(each) if receiver else [] for each in ("brokers", "off_floor")]
        if (positions := positions_document(receiver or []))["robots"]:
            positions = positions_document(receiver or [], await self._listed("senders"))
        parts = {
            "delivery": self._engine.delivery.document(time.monotonic(), self._engine.measures),
            "recording": self._recording.document(),
            "admission": admission_document(receiver or []),
            "pairs": pairs_document(self._engine.measures),
            "positions": positions,
            "brokers": brokers_document(brokers),
            "files": self.files.document(time.monotonic(), {LOSSES: self._ledger.outage}),
            "certificates": self.certificates.document(self.history.site, time.time()),
            "refused_or_lost": self._refusals.document(time.monotonic()),
            "supervisor": supervisor_health(self._runtime),
            "clock": self.clock.document(),
            "off_floor": off_floor_document(off_floor),
        }
        if self.is_alone:
            parts["cluster"] = health_part([ALONE])
        else:
            parts["canary"] = self._engine.canary.document(time.monotonic())
        if self._is_cluster:
            parts["members"] = await self._members()
        is_ok = all(up.values()) and all(part["status"] == "ok" for part in parts.values())
        return {
            "status": "ok" if is_ok else "degraded",
            "roles": {role: "up" if alive else "down" for role, alive in up.items()},
            "restarts": restarts(processes),
            "preparing": preparation(self._runtime),
            "effort": self._effort(),
            "notice": self.notice,
            **parts,
            "site": {key: results[key] for key in ("problems", "needs_restart")} if results else {},
        }

    async def watch_refusals(self, own: Sequence[Measures]) -> None:
        """Look again and again at what the roles refuse and lose, until cancelled. `own` are measures of this role."""
        while True:
            now_s = time.monotonic()
            roles = {"operator": [measures.as_document() for measures in own], "engine": self._engine.measures}
            for role, documents in (roles | {"receiver": await self._receiver_measures() or []}).items():
                if documents:
                    self._refusals.note_measures(role, documents, now_s)
            self._refusals.looked_s = time.monotonic()
            await asyncio.sleep(REFUSALS_EVERY_S)

    async def reload(self) -> dict[str, Any]:
        """Ask the supervisor to read the site file again, and wait for the result."""
        before = reload_results(self._runtime)
        if before is None:
            raise SourceUnavailableError("supervisor")
        (self._runtime / REQUEST_FILE).touch()
        with suppress(TimeoutError):
            async with asyncio.timeout(RELOAD_TIMEOUT_S):
                while True:
                    await asyncio.sleep(RELOAD_CHECK_S)
                    results = reload_results(self._runtime)
                    if results and results["applied"] + results["refused"] > before["applied"] + before["refused"]:
                        return results | {"applied": not results["problems"]}
        raise SourceUnavailableError("supervisor")

    async def follow(self, number: int) -> tuple[int, bool, Batch | None]:
        return unpacked_batch(await self._receiver.call("follow", str(number).encode()))

    async def live_status(self) -> dict[str, Any]:
        """Roles, vendors, unidentified robots (none if the receiver does not answer), silent and distrusted robots.

        `fading` has the probability that each silent robot is still there, `taken_off` when each robot that is
        no longer there was heard last.
        """
        receiver = await self._receiver_measures()
        documents = [*self._engine.measures, *(receiver or [])]
        members: str = (await self._members()).get("reason", "")
        up = await self._roles_up(receiver is not None, role_processes(self._runtime))
        lists = {each: await self._listed(each) if receiver is not None else [] for each in LIVE_QUESTIONS}
        presence = self._engine.presence
        return {
            "roles": {role: "up" if alive else "down" for role, alive in up.items()},
            "vendors": {
                vendor.name: vendor.model_dump(mode="json", exclude={"name"})
                for vendor in vendor_health(documents, lists["senders"])
            },
            "brokers": broker_notes(lists["brokers"]),
            "preparing": preparation(self._runtime),
            "engine_starting": self._is_first_engine_starting(),
            "effort": self._effort(),
            "notice": " ".join(filter(None, [self.notice, self.clock.notice, members and f"{members}."])),
            "delivery": self._engine.delivery.document(time.monotonic(), self._engine.measures),
            "unidentified": lists["unidentified"],
            "off_floor": lists["off_floor"],
            "fading": presence["fading"],
            "taken_off": {uuid: removal["heard_s"] for uuid, removal in presence["taken_off"].items()},
            "distrusted": presence.get("distrusted", []),
        }

    async def losses(self, question: LossQuestion) -> LossList:
        try:
            return await asyncio.to_thread(self._ledger.ask, question)
        except sqlite3.Error as error:
            raise StoreError(f"the ledger of losses can't be read: {error}") from error

    def blackboxes(self) -> list[dict[str, Any]]:
        try:
            return self._archive.boxes()
        except OSError as error:
            raise StoreError(f"the register of black boxes can't be read: {error}") from error

    def blackbox(self, file: str) -> Path | None:
        return self._archive.path(file)

    async def recorded(self) -> tuple[float, float] | None:
        if self._is_cluster:
            with suppress(LinkDownError):
                from_s, to_s = json.loads(await self._receiver.call("recorded"))
                return (from_s, to_s) if to_s else None
        return await asyncio.to_thread(self.history.recorded)

    async def floor_at(self, at_s: float) -> str:
        if self._is_cluster:
            with suppress(LinkDownError):
                return (await self._receiver.call("past", str(at_s).encode(), PAST_TIMEOUT_S)).decode()
        try:
            return await self.history.read(floor_at, at_s)
        except BusyError as error:
            raise SourceUnavailableError("recording") from error

    async def _receiver_measures(self) -> list[dict[str, Any]] | None:
        """None if the receiver does not answer. Waits less than other calls, because health checks wait for it."""
        try:
            documents: list[dict[str, Any]] = json.loads(
                await self._receiver.call("measures", within_s=HEALTH_TIMEOUT_S)
            )
        except LinkDownError:
            return None
        return documents

    async def _roles_up(self, receiver: bool, processes: RoleProcesses) -> dict[str, bool]:
        """Which roles are up; in a cluster, whether one of each is. `receiver` is whether the receiver answers."""
        engine = is_up(processes, "engine", self._engine.received_s, time.monotonic())
        before = await self._cluster_up() if self._is_cluster else {"receiver": receiver}
        before |= {"nats": False} if self.is_alone else {}
        return before | {"engine": engine, "operator": True}

    async def _cluster_up(self) -> dict[str, bool]:
        """Whether the NATS servers are connected and an ingest is alive, as the follower of this machine reports."""
        try:
            up: dict[str, bool] = json.loads(await self._receiver.call("presence", within_s=HEALTH_TIMEOUT_S))
        except LinkDownError:
            return {"nats": False, "ingest": False}
        return up

    async def _members(self) -> dict[str, Any]:
        """The part `members` of the health; empty on a single machine."""
        if not self._is_cluster:
            return {}
        try:
            members: dict[str, Any] = json.loads(await self._receiver.call("members", within_s=HEALTH_TIMEOUT_S))
        except LinkDownError:
            return unknown_members(SILENT_FOLLOWER)
        return members

    async def _missing_role(self) -> str:
        """The role to name in the error when a question has no answer."""
        if not self._is_cluster:
            return "receiver"
        up = await self._cluster_up()
        if not up["nats"]:
            return "NATS server"
        return "follower" if up["ingest"] else "ingest"

    def _effort(self) -> str:
        """The engine's `Effort` in lower case, as of its last report."""
        levels = joined_values(self._engine.measures).get("deconflict_engine_effort_reduced", {})
        return Effort(int(levels.get((), Effort.FULL))).name.lower()

    def _is_first_engine_starting(self) -> bool:
        """Whether no engine has reported yet, and none has failed."""
        return self._engine.received_s == float("-inf") and not restarts(role_processes(self._runtime)).get("engine")

    async def _ask(self, name: str, payload: bytes = b"") -> Any:
        try:
            return json.loads(await self._receiver.call(name, payload))
        except LinkDownError as error:
            raise SourceUnavailableError(await self._missing_role()) from error


def _presence_of(uuid: str, presence: dict[str, Any]) -> dict[str, Any]:
    """Two more fields of a robot's document: the probability that it is still there, and who took it off if anybody."""
    removal = presence["taken_off"].get(uuid)
    probability = 0.0 if removal else presence["fading"].get(uuid, 1.0)
    return {"still_there": probability, "taken_off": removal and {"at_s": removal["at_s"], "by": removal["by"]}}
