"""Headings and velocities that are 0 in one topic of a robot because nobody fills them in: another topic has them."""

from math import hypot
from typing import NamedTuple

from msgspec.structs import replace

from ingest.languages.vda5050.seen.travels import MOVED_M
from ingest.languages.vda5050.vda_messages import Position, Velocity2d

HEADING, VELOCITY = "heading", "velocity"


class FilledIn(NamedTuple):
    """What a message says, without zeros that are not filled in."""

    filled: frozenset[tuple[str, str]]
    """By kind of message, which of the two was ever other than 0."""
    position: Position
    velocity: Velocity2d | None


def filled_in(
    filled: frozenset[tuple[str, str]],
    kind: str,
    position: Position,
    velocity: Velocity2d | None,
    before: Position | None,
    *,
    says_standing: bool,
) -> FilledIn:
    """The motion that a message of a kind says, after those by which `filled` is known.

    A robot that has hardly moved since it was at `before` heads as it did there, else where it drives.
    """
    if position.theta:
        filled |= {(kind, HEADING)}
    elif position.theta == 0.0 and _is_left_out(filled, kind, HEADING):
        stays = before is not None and hypot(position.x - before.x, position.y - before.y) <= MOVED_M
        position = replace(position, theta=before.theta if before and stays else None)
    if velocity and any((velocity.vx, velocity.vy, velocity.omega)):
        filled |= {(kind, VELOCITY)}
    elif velocity and not says_standing and _is_left_out(filled, kind, VELOCITY):
        velocity = None
    return FilledIn(filled, position, velocity)


def _is_left_out(filled: frozenset[tuple[str, str]], kind: str, part: str) -> bool:
    return (kind, part) not in filled and any(each == part for _, each in filled)
