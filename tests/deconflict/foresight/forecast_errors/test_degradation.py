"""A vendor's errors by the second, over hours."""

import numpy as np
import pytest
from numpy.random import Generator, default_rng

from deconflict.foresight.forecast_errors.degradation import DegradationDetector
from deconflict.foresight.forecast_errors.error_ledger import ForecastKind
from deconflict.foresight.forecast_errors.track_kernels import Errors
from deconflict.runtime.learned_state import UnreadableError, packed, unpacked
from ingest.batch import Basis
from ingest.measures.change_detection import LevelChange
from tests.deconflict.foresight.forecast_errors.made_errors import off

NOW_S = 1_790_000_000.0
KINDS = {
    ForecastKind("Alder", "A-7", Basis.PATH): 0,
    ForecastKind("Alder", "A-7", Basis.STATIONARY): 1,
    ForecastKind("Corvid", "C", Basis.PATH): 2,
}


def errors(rng: Generator, kind: int, robots: int, size_m: float) -> Errors:
    """Errors of a few robots three seconds ahead, with heavy tails like real ones."""
    along_m, across_m = size_m * rng.standard_t(3, (2, robots))
    return off(kind, 3, along_m, across_m, np.zeros(3))


def run(
    detector: DegradationDetector, begin_s: int, end_s: int, size_m: float, kind: int = 0, seed: int = 1
) -> list[dict[str, LevelChange]]:
    """The result of each minute while the errors of a vendor's robots have these sizes."""
    rng, by_step = default_rng(seed), []
    for second in range(begin_s, end_s):
        detector.add_errors(errors(rng, kind, 3, size_m), KINDS, NOW_S + second)
        if second % 60 == 0:
            by_step.append(detector.changed())
    return by_step


def test_worse_forecasts_are_reported_with_their_begin_until_they_recover() -> None:
    detector = DegradationDetector()
    assert not any(run(detector, 0, 7200, 0.1))
    flagged = run(detector, 7200, 10_800, 0.5)[-1]["Alder"]
    assert abs(flagged.since_s - (NOW_S + 7200)) <= 360
    # four in five are within 0.27 m, and then within 1.35 m
    assert flagged.by == pytest.approx(1.1, abs=0.25)
    assert run(detector, 10_800, 14_400, 0.1)[-1] == {}


@pytest.mark.parametrize("seed", range(4))
def test_a_steady_vendor_is_never_flagged_in_a_day(seed: int) -> None:
    detector, rng = DegradationDetector(), default_rng(seed)
    by_step = []
    for step in range(0, 86_400, 10):
        busy = 1 + 0.2 * np.sin(2 * np.pi * step / 86_400)
        detector.add_errors(errors(rng, 0, 10, 0.2 * busy), KINDS, NOW_S + step)
        by_step.append(detector.changed())
    assert not any(by_step)


def test_each_vendor_is_compared_with_itself_and_standing_robots_do_not_count() -> None:
    detector = DegradationDetector()
    run(detector, 0, 7200, 1.5, kind=2)
    run(detector, 0, 7200, 0.1)
    run(detector, 7200, 9000, 1.5, kind=2)
    run(detector, 7200, 9000, 1.5, kind=1)
    assert run(detector, 7200, 9000, 0.1)[-1] == {}


def test_the_usual_level_is_kept_over_a_restart() -> None:
    detector, resumed = DegradationDetector(), DegradationDetector()
    run(detector, 0, 7200, 0.1)
    resumed.resume(unpacked(packed({"detector": detector.learned()}))["detector"])
    assert "Alder" in run(resumed, 7200, 9000, 0.5)[-1]
    with pytest.raises(UnreadableError):
        resumed.resume({"Alder": 3})
