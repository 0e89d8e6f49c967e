"""A short run of each target. `python -m tests.fuzz` makes a long one."""

import sys
from random import Random

import pytest
from numba.core.dispatcher import Dispatcher

from ingest.languages.massrobotics.parser import read
from ingest.languages.model import Rejection
from tests.fuzz.compiled import compiled_modules
from tests.fuzz.mutation import mutated
from tests.fuzz.targets import TARGETS

INPUTS = {"message": 4000, "floor": 40, "vda5050": 60, "iso21423": 60, "site": 100}


@pytest.mark.parametrize("name", TARGETS)
def test_no_mutated_input_breaks_a_promise(name: str) -> None:
    target, random = TARGETS[name], Random(1)
    for seed in target.seeds:
        target.run(seed)
    for _ in range(INPUTS[name]):
        target.run(mutated(random.choice(target.seeds), random, target.form))


def test_mutated_messages_are_partly_accepted_and_partly_rejected() -> None:
    target, random = TARGETS["message"], Random(2)
    messages = [read(mutated(random.choice(target.seeds), random, target.form)) for _ in range(1000)]
    rules = {message.rule for message in messages if isinstance(message, Rejection)}
    assert 300 < sum(not isinstance(message, Rejection) for message in messages) < 900
    assert len(rules) > 8
    assert len({rule for message in messages for rule in message.findings}) > 30


def test_modules_with_kernels_are_not_instrumented() -> None:
    ours = {name: module for name, module in sys.modules.items() if name.startswith(("ingest", "deconflict"))}
    compiled = {
        value.py_func.__module__
        for module in ours.values()
        for value in vars(module).values()
        if isinstance(value, Dispatcher)
    }
    assert len(compiled) > 3
    assert compiled <= set(compiled_modules())
