"""Drills: short scripts, each of which leads to one kind of advisory. All run at the same time.

Each has its own area in the datum of the demo's ground hall, south of the hall, far away from the others.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from deconflict.settings.shared_places import Resource, Zone
from deconflict.settings.site import Site
from deconflict.settings.site_file import load
from deconflict.simulation.demo.demo_site import demo_site
from deconflict.simulation.drills.errands import Errand, Visit
from deconflict.simulation.participants import ALDER, BASALT, CORVID, WALKER, Make, Participant
from deconflict.simulation.vendors.dialects import GROUND_ID
from deconflict_client.advisory import Kind

APART_M = 50.0
"""Distance from one drill's origin to the next."""
NORTH_M = -60.0
FIRST_NUMBER = 60
"""First number of the robots. The device of a person knows its path if the number is a multiple of three."""

EARLY = {"confirm": (2, 3), "raise_probability": 0.3}
"""Drills raise conflicts early, so that there is time to follow the advice."""

Spot = tuple[float, float]


@dataclass
class DrillSetup:
    """The setup of one drill: places and robots around an origin."""

    origin: Spot
    number: int
    ignored: bool = False
    """Whether all robots ignore advice."""
    resources: list[Resource] = field(default_factory=list)
    zones: list[Zone] = field(default_factory=list)
    errands: list[Errand] = field(default_factory=list)

    def at(self, x: float, y: float) -> Spot:
        return self.origin[0] + x, self.origin[1] + y

    def resource(self, place: str, x: float, y: float, kind: str, size: Spot = (2.0, 2.0), **settings: object) -> None:
        polygon = self._box(x, y, size)
        whole = {"id": place, "datum": GROUND_ID, "kind": kind, "polygon": polygon} | settings
        self.resources.append(Resource.model_validate(whole))

    def aisle(self, place: str, west: float, east: float) -> None:
        polygon = self._box((west + east) / 2, 0.0, (east - west, 1.8))
        axis = (self.at(west, 0.0), self.at(east, 0.0))
        self.zones.append(Zone(id=place, datum=GROUND_ID, kind="aisle", polygon=polygon, axis=axis, capacity=2))

    def robot(self, make: Make, start: Spot, *visits: Visit, ignores_advice: bool = False) -> None:
        moved = [Visit(*self.at(visit.x_m, visit.y_m), visit.place, visit.stay_s, visit.state) for visit in visits]
        member = Participant(self.number + len(self.errands), make)
        self.errands.append(Errand(member, self.at(*start), moved, ignores_advice=ignores_advice or self.ignored))

    def _box(self, x: float, y: float, size: Spot) -> tuple[Spot, Spot, Spot, Spot]:
        w, d = size[0] / 2, size[1] / 2
        return self.at(x - w, y - d), self.at(x + w, y - d), self.at(x + w, y + d), self.at(x - w, y + d)


def aisle_head_on(setup: DrillSetup) -> None:
    """Two robots enter a single lane from both ends."""
    setup.aisle("aisle", 0.0, 12.0)
    setup.robot(ALDER, (-8, 0), Visit(21, 0))
    setup.robot(BASALT, (20, -8), Visit(13.2, 0), Visit(-3, 0))


def swap(setup: DrillSetup) -> None:
    """Two robots at docks, each of which needs the other's dock. There is parking nearby."""
    setup.resource("swap-west", 0, 0, "dock")
    setup.resource("swap-east", 12, 0, "dock")
    setup.resource("swap-parking", 6, -7, "parking")
    setup.robot(ALDER, (0, 0), Visit(0, 0, "swap-west", 14), Visit(12, 0, "swap-east", 2))
    setup.robot(BASALT, (12, 0), Visit(12, 0, "swap-east", 14), Visit(0, 0, "swap-west", 2))


def ring_of_three(setup: DrillSetup) -> None:
    """Three robots at docks, each of which needs the next one's dock. There is parking nearby."""
    spots = ((0.0, 0.0), (14.0, 0.0), (7.0, 11.0))
    for row, (x, y) in enumerate(spots):
        setup.resource(f"ring-{row}", x, y, "dock")
    setup.resource("ring-parking", 7, -8, "parking")
    for row, make in enumerate((ALDER, BASALT, ALDER)):
        after = (row + 1) % 3
        setup.robot(make, spots[row], Visit(*spots[row], f"ring-{row}", 14), Visit(*spots[after], f"ring-{after}", 2))


def lift_with_a_twin(setup: DrillSetup) -> None:
    """A robot comes to an occupied lift whose twin is free."""
    setup.resource("lift-west", 0, 0, "lift", group="lifts", service_s=30.0)
    setup.resource("lift-east", 6, 0, "lift", group="lifts", service_s=30.0)
    setup.robot(ALDER, (0, 0), Visit(0, 0, "lift-west", 30), Visit(-8, 0))
    setup.robot(BASALT, (3, -12), Visit(0, 0, "lift-west", 10), Visit(3, -12))


def charger_queue(setup: DrillSetup) -> None:
    """Two robots come to an occupied charger. The one that stays longer comes first."""
    setup.resource("charger", 0, 0, "charger", service_s=12.0)
    setup.robot(ALDER, (0, 0), Visit(0, 0, "charger", 15, "charging"), Visit(0, 7))
    setup.robot(BASALT, (-13, 0), Visit(0, 0, "charger", 12, "charging"), Visit(-4, -5))
    setup.robot(ALDER, (15, 0), Visit(0, 0, "charger", 4, "charging"), Visit(0, -7))


def dock_taken(setup: DrillSetup) -> None:
    """A robot comes to a dock where another still stands."""
    setup.resource("dock", 0, 0, "dock", size=(6.0, 3.0))
    setup.robot(ALDER, (-1.5, 0), Visit(-1.5, 0, "dock", 24), Visit(-1.5, 7))
    setup.robot(BASALT, (14, 0), Visit(1.5, 0, "dock", 5), Visit(1.5, -5))


def crossing_of_four(setup: DrillSetup) -> None:
    """Robots of three vendors and a person come to one crossing from four sides at the same time."""
    for make, x, y in ((ALDER, -1, 0), (CORVID, 1, 0), (BASALT, 0, -1), (WALKER, 0, 1)):
        setup.robot(make, (13 * x + y, 13 * y - x), Visit(y - 13 * x, -x - 13 * y))


def ignoring_robots(setup: DrillSetup) -> None:
    """Two robots cross. They are advised who should wait, and ignore it."""
    setup.robot(ALDER, (-13, 0), Visit(13, 0), ignores_advice=True)
    setup.robot(BASALT, (0, -13), Visit(0, 13), ignores_advice=True)


@dataclass(frozen=True, slots=True)
class Drill:
    """One script, and the advisory that it should cause."""

    name: str
    kind: Kind
    """Kind of that advisory."""
    script: Callable[[DrillSetup], None]
    heeds: bool = True
    """Whether its robots follow advice."""


DRILLS = (
    Drill("aisle head-on", "deadlock", aisle_head_on),
    Drill("swap", "deadlock", swap),
    Drill("ring of three", "deadlock", ring_of_three),
    Drill("lift with a twin standing free", "contention", lift_with_a_twin),
    Drill("charger queue", "contention", charger_queue),
    Drill("dock taken", "contention", dock_taken),
    Drill("crossing of four vendors", "conflict", crossing_of_four),
    Drill("robots that ignore advice", "conflict", ignoring_robots, heeds=False),
)


def set_up_drills(drills: Sequence[Drill] = DRILLS, *, ignored: bool = False) -> tuple[Site, list[DrillSetup]]:
    """The demo's site on free ports with the places of these drills, and the setup of each drill.

    With `ignored` all robots ignore advice.
    """
    setups = []
    for row, drill in enumerate(drills):
        origin = (APART_M * (row % 4) - APART_M, NORTH_M - APART_M * (row // 4))
        setup = DrillSetup(origin, FIRST_NUMBER + 6 * row, ignored)
        drill.script(setup)
        setups.append(setup)
    site = load(demo_site())
    changes = {
        "conflict": site.conflict.model_copy(update=EARLY),
        "resources": tuple(resource for setup in setups for resource in setup.resources),
        "zones": tuple(zone for setup in setups for zone in setup.zones),
        "receiver": site.receiver.model_copy(update={"port": 0}),
        "operator": site.operator.model_copy(update={"port": 0}),
    }
    return site.model_copy(update=changes), setups
