"""The drills through the whole service: sockets in, and a service of the site that follows the stream."""

from pathlib import Path

from deconflict.simulation.drills.drill_run import played
from deconflict.simulation.drills.drill_scripts import DRILLS
from metrics.monitoring.exposition import render


async def test_following_the_advice_of_the_running_service_ends_each_drill_at_the_promised_cost(tmp_path: Path) -> None:
    outcomes = dict(zip(DRILLS, await played(DRILLS, tmp_path / "first", render), strict=True))
    prevented = [drill for drill, outcome in outcomes.items() if not outcome.told and outcome.passed_on]
    assert len(prevented) <= 1
    assert all(outcomes[drill].through for drill in prevented)
    if prevented:  # advice on a conflict came before the deadlock was foreseen: on a busy machine either may be first
        outcomes |= dict(zip(prevented, await played(prevented, tmp_path / "again", render), strict=True))
    for drill, outcome in outcomes.items():
        assert outcome.ended, outcome
        assert outcome.advised, outcome
        assert outcome.kept is drill.heeds, outcome


async def test_following_only_situations_of_the_running_service_resolves_each_drill(tmp_path: Path) -> None:
    outcomes = await played(DRILLS, tmp_path, render, source="situations")
    for outcome in outcomes:
        assert outcome.resolved, outcome
