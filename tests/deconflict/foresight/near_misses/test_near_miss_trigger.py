from dataclasses import dataclass

import numpy as np

from deconflict.foresight.near_misses.near_events import NearMissTrigger
from deconflict.sweep.incremental import Sweeper
from ingest.batch import Forecasts


@dataclass
class Stage:
    """Two squares of a metre, the second put where the test says."""

    trigger: NearMissTrigger
    sweeper: Sweeper
    now_s: float = 0.0

    def at(self, gap_m: float) -> list[tuple[str, str]]:
        self.now_s += 1.0
        two = Forecasts(
            start=np.array([0, 1, 2]),
            t_s=np.full(2, self.now_s),
            x_m=np.array([0.0, 1.0 + gap_m]),
            y_m=np.zeros(2),
            yaw_rad=np.zeros(2),
            floor=np.zeros(2, np.int64),
            length_m=np.ones(2),
            width_m=np.ones(2),
            bottom_m=np.zeros(2),
            top_m=np.ones(2),
        )
        self.sweeper.update(["a", "b"], two)
        return self.trigger.new_pairs(self.sweeper.find_conflicts(self.now_s))


def test_a_pair_triggers_once_until_it_has_drawn_apart() -> None:
    stage = Stage(NearMissTrigger(0.3, 0.4), Sweeper(clearance_m=0.5))
    triggered = [stage.at(gap_m) for gap_m in (1.0, 0.45, 0.25, 0.0, 0.35, 0.2, 0.45, 0.25)]
    assert [bool(each) for each in triggered] == [False, False, True, False, False, False, False, True]
    assert triggered[2] == [("a", "b")]
