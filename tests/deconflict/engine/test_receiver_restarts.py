"""Batches of a receiver before and after a restart, which number the floors in other orders."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, permutations
from typing import Any

import numpy as np
import pytest

from deconflict.engine.engine import Engine
from deconflict.settings.site import Conflict, Site
from deconflict_client.advisory import AdvisoryState, AnyAdvisory, ConflictAdvisory
from ingest.batch import Batch, Ints
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.shown.quarantine import Quarantine
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Datum
from tests.helpers.saying import HALL, LOFT, angle, identity, points, robot, status

CELLAR = "0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1b03"
FLOORS = (HALL, LOFT, CELLAR)
ORDERS = list(chain.from_iterable(permutations(FLOORS, count) for count in (1, 2, 3)))
"""Orders in which the floors are named after the restart; some floors may not be named again for a while."""
SITE = Site(
    datums=tuple(Datum(id=floor, name=floor[-2:]) for floor in FLOORS),
    conflict=Conflict(clearance_m=0.3, confirm=(2, 3), clear_after_s=1.0),
)
NOW_S, LINE = 1_790_000_000.0, Connection(1)
TICKS = 2
"""A second."""
SILENT_S, RESTART_S, BACK_S, END_S = 3, 8, 16, 26


@dataclass
class Receiver:
    """A receiver with its engine. Robots stand at x = 0 on some floors and fall silent; on each floor one drives there.

    The silent robot of the loft returns at the end, in the cellar.
    """

    order: Sequence[str]
    """The order in which the floors are named after the restart."""
    restarts: bool
    engine: Engine = field(default_factory=lambda: Engine(SITE))
    advisories: list[AnyAdvisory] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.fleet = self._started()

    def _started(self) -> Fleet:
        """A fleet that has read the identities from the recording. No robot was heard lately."""
        fleet = Fleet(VendorRegistry(()), FrameRegistry(SITE.datums, ()), SITE.reading, Measures(), Quarantine())
        for name in ("stands loft", "stands hall", *(f"drives {floor}" for floor in FLOORS)):
            fleet.receive(identity(name, NOW_S), NOW_S, LINE)
        return fleet

    def run(self) -> list[AnyAdvisory]:
        for tick in range(END_S * TICKS):
            t = tick / TICKS
            if t == RESTART_S and self.restarts:
                self.fleet = self._started()
            if tick % TICKS == 0:
                self._report(t)
            batch = self.fleet.next_batch(NOW_S + t)
            self.engine.receive(Batch.from_bytes(batch.to_bytes()))
            self.advisories += self.engine.step(NOW_S + t)
        return self.advisories

    def _report(self, t: float) -> None:
        if t <= SILENT_S:
            self._stand("stands hall", t, HALL)
            self._stand("stands loft", t, LOFT)
        elif t >= BACK_S:
            self._stand("stands loft", t, CELLAR)
        for floor in FLOORS if t < RESTART_S else self.order:
            self._drive(f"drives {floor}", t, floor)

    def _stand(self, name: str, t: float, floor: str) -> None:
        location = {"x": 0.0, "y": 0.0, "angle": angle(0.0), "planarDatum": floor}
        stop = {**points((NOW_S + 60.0, 1.0, 0.0, 0.0))[0], "planarDatumUUID": floor}
        document: dict[str, Any] = {"operationalState": "idle", "location": location, "destinations": [stop]}
        self.fleet.receive(status(name, NOW_S + t, **document), NOW_S + t, LINE)

    def _drive(self, name: str, t: float, floor: str) -> None:
        """Drive along x, to arrive at the middle of the floor some time after the restart."""
        x = t - 15.0 - 1.5 * FLOORS.index(floor)
        path = points(*((NOW_S + t + i, x + i, 0.0, 0.0) for i in range(1, 11)))
        location = {"x": x, "y": 0.0, "angle": angle(0.0), "planarDatum": floor}
        self.fleet.receive(status(name, NOW_S + t, path=path, location=location), NOW_S + t, LINE)


def raised(advisories: Sequence[AnyAdvisory]) -> set[tuple[str, frozenset[str]]]:
    conflicts = [
        advisory
        for advisory in advisories
        if isinstance(advisory, ConflictAdvisory) and advisory.state is AdvisoryState.RAISED
    ]
    return {(conflict.location.datum, frozenset(conflict.robots)) for conflict in conflicts}


@pytest.mark.parametrize("order", ORDERS, ids=lambda order: " ".join(floor[-2:] for floor in order))
def test_a_restarted_receiver_that_names_floors_in_another_order_changes_no_advisory(order: Sequence[str]) -> None:
    uninterrupted, restarted = Receiver(order, restarts=False).run(), Receiver(order, restarts=True).run()
    assert restarted == uninterrupted
    expected = {(HALL, frozenset({robot("stands hall"), robot(f"drives {HALL}")}))} if HALL in order else set()
    assert raised(restarted) >= expected
    assert all(robot("stands hall") not in pair or datum == HALL for datum, pair in raised(restarted))


def with_floor(batch: Batch, row: int, floor: int) -> Batch:
    """The batch, with a robot's forecast on another floor."""
    floors = batch.forecasts.floor.copy()
    floors[batch.forecasts.start[row] : batch.forecasts.start[row + 1]] = floor
    return replace(batch, forecasts=replace(batch.forecasts, floor=floors))


def with_stop_on(batch: Batch, row: int, floor: int) -> Batch:
    """The batch, with a robot's destinations on another floor."""
    floors: Ints = batch.destinations.floor.copy()
    floors[batch.destinations.start[row] : batch.destinations.start[row + 1]] = floor
    return replace(batch, destinations=replace(batch.destinations, floor=floors))


@pytest.mark.parametrize("change", [with_floor, with_stop_on])
@pytest.mark.parametrize("floor", [3, 1 << 40, -2])
def test_a_robot_on_a_floor_that_its_batch_does_not_list_is_refused_and_counted(
    change: Callable[[Batch, int, int], Batch], floor: int
) -> None:
    receiver = Receiver(FLOORS, restarts=False)
    receiver._report(0.0)
    batch = receiver.fleet.next_batch(NOW_S)
    row, engine = batch.robots.index(robot("stands loft")), Engine(SITE)
    wrong = change(batch, row, floor)
    for t in range(3):
        engine.receive(Batch.from_bytes(replace(wrong, arrival_s=wrong.arrival_s + t).to_bytes()))
        engine.step(NOW_S + t)
    assert set(engine.live.robots) == set(batch.robots) - {robot("stands loft")}
    assert engine.measures.values["deconflict_invalid_forecasts_total"] == {("floor-not-listed",): 3}
    engine.receive(batch)
    engine.receive(wrong)
    engine.step(NOW_S + 3)
    known = engine.live.robots[robot("stands loft")].forecast
    assert engine.live.floors[known.floor[0]] == LOFT
    assert np.isfinite(known.x_m).all()
