"""What is broken in each phase of the drill: each is a block that breaks something, waits, and mends it at its end.

Each gives the machines whose faces it stops.
"""

from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import dataclass

from benchmarks.cluster_drill.cluster_view import ClusterView
from benchmarks.cluster_drill.drilled_machines import MACHINES, DrilledMachines

Stopped = frozenset[int]
Fault = Callable[[DrilledMachines, ClusterView], AbstractAsyncContextManager[Stopped]]
NO_FACE: Stopped = frozenset()
INGEST, FACE = ("receiver", "feed"), ("operator", "follower")


@asynccontextmanager
async def nothing(_: DrilledMachines, __: ClusterView) -> AsyncIterator[Stopped]:
    yield NO_FACE


@asynccontextmanager
async def no_ingest(machines: DrilledMachines, _: ClusterView) -> AsyncIterator[Stopped]:
    machines.kill_roles(1, *INGEST)
    yield NO_FACE
    machines.revive(1)


@asynccontextmanager
async def no_engine(machines: DrilledMachines, view: ClusterView) -> AsyncIterator[Stopped]:
    """Of one that is not the judge."""
    judge = await view.judge()
    machine = next(each for each in MACHINES if each != judge)
    machines.kill_roles(machine, "engine")
    yield NO_FACE
    machines.revive(machine)


@asynccontextmanager
async def no_judge(machines: DrilledMachines, view: ClusterView) -> AsyncIterator[Stopped]:
    machine = await view.judge()
    machines.kill_roles(machine, "engine")
    yield NO_FACE
    machines.revive(machine)


@asynccontextmanager
async def no_face(machines: DrilledMachines, _: ClusterView) -> AsyncIterator[Stopped]:
    machines.kill_roles(2, *FACE)
    yield frozenset({2})
    machines.revive(2)


@asynccontextmanager
async def no_leader(machines: DrilledMachines, view: ClusterView) -> AsyncIterator[Stopped]:
    """Without the NATS server that leads the stream of revisions."""
    server = await view.leader()
    machines.kill_nats(server)
    yield NO_FACE
    machines.start_nats(server)


@asynccontextmanager
async def no_machine(machines: DrilledMachines, _: ClusterView) -> AsyncIterator[Stopped]:
    """Without one with its NATS server."""
    machines.kill_machine(3)
    machines.kill_nats(3)
    yield frozenset({3})
    machines.start_nats(3)
    machines.start_machine(3)


@asynccontextmanager
async def no_nats(machines: DrilledMachines, _: ClusterView) -> AsyncIterator[Stopped]:
    for server in MACHINES:
        machines.kill_nats(server)
    yield NO_FACE
    for server in MACHINES:
        machines.start_nats(server)


@asynccontextmanager
async def no_engines(machines: DrilledMachines, _: ClusterView) -> AsyncIterator[Stopped]:
    for machine in MACHINES:
        machines.kill_roles(machine, "engine")
    yield NO_FACE
    for machine in MACHINES:
        machines.revive(machine)


@dataclass(frozen=True, slots=True)
class DrillPhase:
    """A fault that is held for a while."""

    name: str
    fault: Fault
    held_s: float
    after_s: float = 30.0
    """How long it goes on after the repair."""
    spares_apart: bool = False
    """Whether nobody can warn of robots that no machine hears both, as long as the fault lasts; and of others one face
    is enough."""
    spares_all: bool = False
    """Whether nobody can warn of anything, as long as the fault lasts."""


PHASES = {
    phase.name: phase
    for phase in (
        DrillPhase("quiet", nothing, 30.0, 0.0),
        DrillPhase("ingest", no_ingest, 12.0),
        DrillPhase("engine", no_engine, 10.0),
        DrillPhase("judge", no_judge, 10.0),
        DrillPhase("face", no_face, 10.0),
        DrillPhase("nats-server", no_leader, 25.0),
        DrillPhase("machine", no_machine, 15.0, 40.0),
        DrillPhase("nats-gone", no_nats, 15.0, 40.0, spares_apart=True),
        DrillPhase("engines-gone", no_engines, 7.0, spares_all=True),
    )
}
