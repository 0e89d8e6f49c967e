"""What a device on the floor stands for."""

from typing import Literal

ParticipantKind = Literal["robot", "person", "driven"]
"""A robot, a person on foot, or a vehicle with a driver."""
