"""What a conflict is expected to cost: a rough amount of time, to tell what is worth waiting for. No forecast."""

from deconflict.advisory import ConflictAdvisory, EncounterClass

ENCOUNTER_COST_S = {
    EncounterClass.HEAD_ON: 20.0,
    EncounterClass.CROSSING: 6.0,
    EncounterClass.FOLLOWING: 4.0,
    EncounterClass.STATIONARY_OBSTACLE: 8.0,
}
"""What the two robots lose if they get in each other's way."""


def expected_loss_s(conflict: ConflictAdvisory) -> float:
    """The time that its robots are expected to lose if nobody does anything."""
    return (conflict.probability or 0.0) * ENCOUNTER_COST_S[conflict.encounter_class]
