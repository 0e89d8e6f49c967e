"""Stretched time, and the floors of the load that a cluster in slow motion gets."""

import json
import subprocess
import sys

import numpy as np
import pytest

from benchmarks.offer import Circling, datum_of

SCRIPT = """
import asyncio, time
from nats.js.api import StreamConfig
from nats.js.manager import JetStreamManager

kept = []

async def keep(self, config):
    kept.append((config.max_age, config.duplicate_window))

JetStreamManager.add_stream = keep
from benchmarks.slow_motion.stretched_time import stretch_time

stretch_time(5.0, began_s := time.time())
assert began_s <= time.time() < began_s + 1000.0

async def wait():
    outer_s = time.perf_counter()
    simulated_s, host_s = asyncio.get_running_loop().time(), time.time()
    inner_s = time.perf_counter()
    await asyncio.sleep(0.02)
    inner_s = time.perf_counter() - inner_s
    simulated_s, host_s = asyncio.get_running_loop().time() - simulated_s, time.time() - host_s
    outer_s = time.perf_counter() - outer_s
    assert inner_s <= 5 * simulated_s + 1e-4 and 5 * simulated_s <= outer_s + 1e-4, (inner_s, simulated_s, outer_s)
    assert simulated_s >= 0.02 and host_s >= 0.0199, (simulated_s, host_s)
    await JetStreamManager.add_stream(None, StreamConfig(name="rows", max_age=30.0, duplicate_window=12.0))

asyncio.run(wait())
assert kept == [(150.0, 60.0)], kept
"""


def test_in_stretched_time_clocks_and_waits_are_slow_and_the_server_keeps_for_longer() -> None:
    ended = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr


@pytest.mark.parametrize("docks", [False, True])
def test_floors_of_a_load_share_no_robot_and_each_has_a_datum_of_its_own(docks: bool) -> None:
    first, second = (Circling(10, docks=docks, floor=floor) for floor in (0, 1))
    assert not {*first.uuids} & {*second.uuids}
    for floor, world in enumerate((first, second)):
        status = json.loads(world.statuses(np.array([3]), 1e9, 1e9 + 1.0)[0])
        points = [*status["path"], *status.get("destinations", [])]
        assert {status["location"]["planarDatum"], *(each["planarDatumUUID"] for each in points)} == {datum_of(floor)}
        assert status["uuid"] == world.uuids[3]
