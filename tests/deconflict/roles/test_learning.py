"""What was learned of vendors goes on over a restart of the roles, and a damaged file of it stops nothing."""

import asyncio
from pathlib import Path

import numpy as np
import pytest

from deconflict.engine.engine import Engine
from deconflict.foresight.learned_estimates import estimator_learners
from deconflict.operator.store.learned_file import FILE_NAME
from deconflict.runtime.learned_state import learned_of, packed, resume_all, unpacked
from deconflict.settings.site import Site
from tests.deconflict.foresight.probability.made_stage import Stage, Walk
from tests.deconflict.roles.made_service import drive, running
from tests.helpers.patience import PATIENCE_S


def test_a_resumed_engine_predicts_like_one_that_never_stopped() -> None:
    def stage() -> Stage:
        return Stage({"a": Walk((0.0, -20.0), (0.0, 1.0), says=(0.2, 1.1)), "b": Walk((-20.0, 0.0), (1.0, 0.0))})

    steady, stopped = stage(), stage()
    for staged in (steady, stopped):
        staged.run(15)
    resumed = stage()
    kept = packed(learned_of(estimator_learners(stopped.foresight)))
    assert not resume_all(estimator_learners(resumed.foresight), unpacked(kept))
    assert resumed.foresight.ledger.kinds == steady.foresight.ledger.kinds
    assert np.allclose(resumed.foresight.ledger.bands_m, steady.foresight.ledger.bands_m)
    after, unbroken = resumed.foresight.learning.calibration, steady.foresight.learning.calibration
    assert after.of_all.weights.tolist() == unbroken.of_all.weights.tolist()


def test_probabilities_learned_at_another_clearance_are_not_used() -> None:
    stage = Stage({"a": Walk((0.0, 0.0), (0.0, 0.0)), "b": Walk((-12.0, 0.0), (1.0, 0.0))})
    stage.run(30)
    learned = learned_of(estimator_learners(stage.foresight))
    wider = Engine(Site.model_validate({"conflict": {"clearance_m": 0.5}}), learned=learned)
    before, after = stage.foresight.learning.calibration, wider.foresight.learning.calibration
    assert after.of_all.weights.tolist() != before.of_all.weights.tolist()
    assert wider.foresight.ledger.kinds


async def test_learned_state_of_a_vendor_survives_a_restart(tmp_path: Path) -> None:
    covered = 'deconflict_forecast_band_coverage_ratio{share="0.8",vendor="Alder"}'
    async with running(tmp_path) as service:
        await drive(service.robots_url, {"A-1": lambda t: (0.8 * t, 0.0, 0.0)}, 5)
        await service.metrics_with(covered)
    async with running(tmp_path) as service:
        # nobody speaks: it rests on what was seen before
        await service.metrics_with(covered)


def _kept(data: Path) -> list[list[str | int]]:
    """The kinds of forecasts that are known on the disk."""
    file = data / FILE_NAME
    return unpacked(file.read_bytes())["ledger"]["kinds"] if file.exists() else []


async def test_a_killed_engine_loses_at_most_a_minute_of_learned_state(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deconflict.roles.engine_role.LEARNED_EVERY_S", 0.2)
    async with running(tmp_path) as service:
        await drive(service.robots_url, {"A-1": lambda t: (0.8 * t, 0.0, 0.0)}, 4)
        async with asyncio.timeout(PATIENCE_S):
            while not (kept := _kept(tmp_path)):
                await asyncio.sleep(0.05)
    assert kept == [["Alder", "A1", 1]]


@pytest.mark.parametrize("damaged", [b"", b"no such file", packed({"ledger": {"kinds": "none"}})])
async def test_a_damaged_learned_file_is_set_aside_and_the_service_runs(tmp_path: Path, damaged: bytes) -> None:
    (tmp_path / FILE_NAME).write_bytes(damaged)
    async with running(tmp_path) as service:
        text = await service.metrics_with("deconflict_sweep_duration_seconds")
    assert f'deconflict_learning_failures_total{{what="read"}} {float(bool(damaged))}' in text
    aside = tmp_path / (FILE_NAME + ".unreadable")
    assert (aside.read_bytes() if damaged else None) == (damaged or None)
    unpacked((tmp_path / FILE_NAME).read_bytes())
