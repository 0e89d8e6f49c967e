"""The drills through the whole service: sockets in, and a service of the site that follows the stream."""

from pathlib import Path

from deconflict.simulation.drills.drill_outcomes import DrillOutcome
from deconflict.simulation.drills.drill_run import played
from deconflict.simulation.drills.drill_scripts import DRILLS, Drill
from metrics.monitoring.exposition import render


async def test_following_the_advice_of_the_running_service_ends_each_drill_at_the_promised_cost(tmp_path: Path) -> None:
    outcomes = dict(zip(DRILLS, await played(DRILLS, tmp_path / "first", render), strict=True))
    others = [drill for drill, outcome in outcomes.items() if not is_as_promised(drill, outcome)]
    assert len(others) <= 1, [outcomes[drill] for drill in others]
    if others:  # the clock is real: on a busy machine advice on a conflict may come before the deadlock, or late
        outcomes |= dict(zip(others, await played(others, tmp_path / "again", render), strict=True))
    for drill, outcome in outcomes.items():
        assert is_as_promised(drill, outcome), outcome


def is_as_promised(drill: Drill, outcome: DrillOutcome) -> bool:
    """Whether people were advised, and following it ended the drill at the promised cost if its robots do."""
    return bool(outcome.through and outcome.ended and outcome.advised) and outcome.kept is drill.heeds


async def test_following_only_situations_of_the_running_service_resolves_each_drill(tmp_path: Path) -> None:
    outcomes = dict(zip(DRILLS, await played(DRILLS, tmp_path / "first", render, source="situations"), strict=True))
    others = [drill for drill, outcome in outcomes.items() if not outcome.resolved]
    assert len(others) <= 2, [outcomes[drill] for drill in others]  # the clock is real, and the machine may be busy
    for again in await played(others, tmp_path / "again", render, source="situations") if others else ():
        assert again.resolved, again
