from collections import Counter

from deconflict_client.participant_kinds import ParticipantKind, counted


def test_people_and_driven_vehicles_are_counted_apart_in_words() -> None:
    counts: dict[ParticipantKind, int] = {"driven": 1, "person": 15, "robot": 1200}
    assert counted(Counter(counts).elements()) == "1,200 robots, 15 people, 1 driven vehicle"
    assert counted([]) == "0 robots"
