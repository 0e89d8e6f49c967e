"""How fast people react, and for how long they can have a robot wait."""

PERSON_REACTION_S = 3.0
"""The shortest useful reaction of a person."""
SHORTEST_WAIT_S = 3.0
"""Nobody can have a robot wait for a shorter time."""
