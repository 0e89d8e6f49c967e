"""A short run of each target; `python -m tests.fuzz` is the long one."""

from random import Random

import pytest

from ingest.messages import Rejection, read
from tests.fuzz.mutation import mutated
from tests.fuzz.targets import TARGETS

INPUTS = {"message": 4000, "floor": 40, "site": 100}


@pytest.mark.parametrize("name", TARGETS)
def test_no_mutated_input_breaks_a_promise(name: str) -> None:
    target, random = TARGETS[name], Random(1)
    for seed in target.seeds:
        target.run(seed)
    for _ in range(INPUTS[name]):
        target.run(mutated(random.choice(target.seeds), random, target.form))


def test_mutation_reaches_what_is_read_and_what_is_refused() -> None:
    target, random = TARGETS["message"], Random(2)
    told = [read(mutated(random.choice(target.seeds), random, target.form)) for _ in range(1000)]
    rules = {one.rule for one in told if isinstance(one, Rejection)}
    assert 300 < sum(not isinstance(one, Rejection) for one in told) < 900
    assert len(rules) > 8
    assert len({rule for one in told for rule in one.findings}) > 30
