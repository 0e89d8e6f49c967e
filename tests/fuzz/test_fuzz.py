"""A short run of each target; `python -m tests.fuzz` is the long one."""

import sys
from random import Random

import pytest
from numba.core.dispatcher import Dispatcher

from ingest.languages.massrobotics.parser import read
from ingest.languages.model import Rejection
from tests.fuzz.compiled import compiled_modules
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


def test_what_numba_compiles_is_left_unmarked() -> None:
    ours = {name: module for name, module in sys.modules.items() if name.startswith(("ingest", "deconflict"))}
    compiled = {
        one.py_func.__module__
        for module in ours.values()
        for one in vars(module).values()
        if isinstance(one, Dispatcher)
    }
    assert len(compiled) > 3
    assert compiled <= set(compiled_modules())
