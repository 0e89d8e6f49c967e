"""What is broken in each phase of the drill, and how it is mended."""

from collections.abc import Callable
from dataclasses import dataclass

from benchmarks.cluster_drill.drilled_machines import MACHINES, DrilledMachines

Act = Callable[[DrilledMachines], None]


@dataclass(frozen=True, slots=True)
class DrillPhase:
    """A fault that is held for a while."""

    name: str
    break_it: Act
    mend_it: Act
    held_s: float
    after_s: float = 30.0
    """How long it goes on after the repair."""
    spares_apart: bool = False
    """Whether nobody can warn of robots at two machines, as long as the fault lasts."""
    spares_all: bool = False
    """Whether nobody can warn of anything, as long as the fault lasts."""


def _nothing(_: DrilledMachines) -> None:
    return


def _of_each(act: Callable[[DrilledMachines, int], None]) -> Act:
    """To each machine or server."""

    def act_on_each(machines: DrilledMachines) -> None:
        for number in MACHINES:
            act(machines, number)

    return act_on_each


def _kill_engine(machines: DrilledMachines, machine: int) -> None:
    machines.kill_roles(machine, "engine")


PHASES = {
    phase.name: phase
    for phase in (
        DrillPhase("quiet", _nothing, _nothing, 30.0, 0.0),
        DrillPhase(
            "nats-gone",
            _of_each(DrilledMachines.kill_nats),
            _of_each(DrilledMachines.start_nats),
            15.0,
            40.0,
            spares_apart=True,
        ),
        DrillPhase("engines-gone", _of_each(_kill_engine), _of_each(DrilledMachines.revive), 7.0, spares_all=True),
    )
}
