"""How robots drive and turn, as far as nobody says it: what all languages and forecasts assume alike."""

from math import ceil, isfinite, pi, remainder

from ingest.frames.angles import turn_between

DRIVES_MPS = 0.1
"""A robot that is faster drives."""
MOVING_MPS = 0.02
"""A robot with at most this speed stands."""
TURNS_RADPS = 0.05
"""A robot that does not drive, but turns faster, turns on the spot."""
SPINS_RADPS = 0.2
"""A robot that turns faster turns on the spot whatever state it says."""
ASSUMED_MPS, ASSUMED_TURN_RADPS = 1.0, 1.0
"""Speed, and turn rate on the spot, if nothing says one."""
CORNER_RAD = 0.35
"""A robot turns on the spot where its direction changes by more than this."""
SPOT_M, LEAST_STEP_S = 1e-3, 1e-3
"""A robot that moves less turns on the spot. Poses of a forecast are at least this time apart."""
PART_RAD = 0.5
"""A turn on the spot has a pose for each part of this size: an envelope off the centre moves straight between two."""


def turn_in_parts(before_rad: float, after_rad: float) -> list[tuple[float, float]]:
    """The parts of the shorter turn: the size of the turn up to each, and the heading there. Empty if one is nan."""
    turn_rad = turn_between(before_rad, after_rad)
    count = ceil(abs(turn_rad) / PART_RAD) if isfinite(turn_rad) else 0
    turned = [turn_rad * part / count for part in range(1, count + 1)]
    return [(abs(part_rad), remainder(before_rad + part_rad, 2 * pi)) for part_rad in turned]
