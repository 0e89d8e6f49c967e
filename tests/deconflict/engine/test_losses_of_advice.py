"""What a robot loses that waits as the engine advises."""

from deconflict.engine.engine import Engine
from deconflict.foresight.losses.loss import LossNotice
from deconflict.foresight.losses.loss_places import PlacedLoss
from ingest.batch import Batch
from tests.deconflict.engine.made_engine import LINE, NOW_S, Floor
from tests.helpers.saying import identity, points, robot, status

AT_M, PASSED_M = 15.0, 17.5
"""Where the ways cross, and where a robot has left the crossing."""
STOPS_M = 12.6


class Crossing:
    """Two robots meet at a crossing. One that is advised to wait does so before it, until the other one has passed. By
    its path it goes on at once."""

    def __init__(self) -> None:
        self.floor = Floor({})
        self.gone_m = {"A-1": 0.0, "B-1": 0.0}
        self.advised: set[str] = set()
        self.losses: list[PlacedLoss] = []

    def run(self, until_s: int, *, heard: bool) -> list[PlacedLoss]:
        fleet, engine = self.floor.fleet, self.floor.engine
        for name in self.gone_m:
            fleet.receive(identity(name, NOW_S), NOW_S, LINE)
        for tick in range(4 * until_s):
            now_s = NOW_S + tick / 4
            self._move()
            if tick % 4 == 0:
                for name in self.gone_m:
                    fleet.receive(self._report(name, now_s), now_s, LINE)
            engine.receive(Batch.from_bytes(fleet.next_batch(now_s).to_bytes()))
            self._step(engine, now_s, heard)
        return self.losses

    def _step(self, engine: Engine, now_s: float, heard: bool) -> None:
        for revision in engine.step(now_s, heard=heard):
            holds = revision.recommendation.holds if revision.recommendation else ()
            self.advised.update(hold.robot for hold in holds)
        self.losses += engine.losses

    def _move(self) -> None:
        for name, gone_m in self.gone_m.items():
            others_m = min(m for other, m in self.gone_m.items() if other != name)
            waits = robot(name) in self.advised and STOPS_M <= gone_m < AT_M and others_m < PASSED_M
            self.gone_m[name] += 0.0 if waits else 0.25

    def _report(self, name: str, now_s: float) -> bytes:
        along = [self.gone_m[name] - AT_M + ahead_s for ahead_s in range(11)]
        poses = [(m, 0.0, 0.0) if name == "A-1" else (0.0, m, 1.5708) for m in along]
        path = points(*((now_s + ahead_s, *poses[ahead_s]) for ahead_s in range(1, 11)))
        return status(name, now_s, *poses[0], path=path)


def test_a_loss_of_a_robot_that_waits_as_advised_was_warned_of_and_the_advice_heeded() -> None:
    (placed,) = Crossing().run(30, heard=True)
    assert placed.notice == LossNotice(is_warned=True, is_advised=True, is_heeded=True)


def test_robots_of_a_log_that_another_service_recorded_heed_no_advice() -> None:
    (placed,) = Crossing().run(30, heard=False)
    assert placed.notice == LossNotice(is_warned=True, is_advised=True, is_heeded=False)
