"""What a conflict is expected to cost: a rough amount of time, to tell what is worth waiting for. No forecast."""

from collections.abc import Iterable

from deconflict_client.advisory import ConflictAdvisory, EncounterClass

ENCOUNTER_COST_S = {
    EncounterClass.HEAD_ON: 20.0,
    EncounterClass.CROSSING: 6.0,
    EncounterClass.FOLLOWING: 4.0,
    EncounterClass.STATIONARY_OBSTACLE: 8.0,
}
"""What the two robots lose if they get in each other's way."""
SAVED_SHARE = 0.5
"""Of the loss that conflicts are expected to cost, what holds save. The rest is lost although robots were held."""
STOP_COST_S = 1.5
"""What a robot loses by stopping and starting again, beside the time for which it stands."""
SLOW_SHARE = 0.5
"""Of the time for which a robot drives slowly, what it loses."""


def expected_loss_s(conflict: ConflictAdvisory) -> float:
    """The time that its robots are expected to lose if nobody does anything."""
    return (conflict.probability or 0.0) * ENCOUNTER_COST_S[conflict.encounter_class]


def saves_time(loss_s: float, waits_s: Iterable[float], slow_s: Iterable[float] = ()) -> bool:
    """Whether it costs less than it saves that robots wait, or drive slowly, to prevent an expected loss."""
    waiting_s = sum(wait_s + STOP_COST_S for wait_s in waits_s)
    return waiting_s + SLOW_SHARE * sum(slow_s) <= SAVED_SHARE * loss_s
