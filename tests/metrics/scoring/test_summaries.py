import statistics
from collections.abc import Callable
from math import isnan, nan

import numpy as np
import pytest

from ingest.batch import Floats
from metrics.scoring import summaries

SAMPLES = ([3.0, 1.0, 2.0, nan], [nan, nan, nan, nan], [1.0, 0.0, 0.0, 1.0], [nan, 5.0, nan, nan])


@pytest.mark.parametrize(
    ("many", "alone", "expected"),
    [
        (summaries.means, summaries.mean, statistics.mean),
        (summaries.medians, summaries.median, statistics.median),
    ],
)
def test_statistics_of_a_sample_use_only_its_known_values(
    many: Callable[[Floats], Floats],
    alone: Callable[[Floats], float | None],
    expected: Callable[[list[float]], float],
) -> None:
    known = [[value for value in sample if not isnan(value)] for sample in SAMPLES]
    each = [expected(values) if values else None for values in known]
    assert [alone(np.array(sample)) for sample in SAMPLES] == each
    np.testing.assert_array_equal(many(np.array(SAMPLES)), np.array(each, np.float64))
    assert alone(np.empty(0)) is None


def test_errors_of_probabilities_are_computed_for_each_sample_of_groups() -> None:
    group = np.array([[10.0, 5.0, 2.0], [10.0, 5.0, 1.0]])
    nothing, certain = np.zeros((2, 3)), np.array([[10.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    every = np.stack([group, nothing, certain])
    np.testing.assert_array_equal(summaries.briers(every), [0.15, nan, 0.1])
    np.testing.assert_array_equal(summaries.brier_skills(every), [1 - 0.15 / 0.25, nan, nan])
    assert summaries.brier(group) == 0.15
    assert summaries.brier(nothing) is summaries.brier_skill(certain) is None
