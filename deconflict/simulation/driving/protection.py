"""How far each robot can drive on its path before its protective field would touch another robot, and which one.

A field is the body, slightly wider, along the robot's own path. It must stay clear of the bodies of others and of the
area that they would still cover if they braked now. So two robots that both brake never touch. A robot knows more of
its own fleet, and a person of all robots: of two, the one with the higher rank number keeps clear of the path that the
other takes in the next 1.5 s.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from deconflict.simulation.driving.drive_table import DriveTable
from ingest.batch import Bools, Floats, Ints

NOBODY = -1
LOOK_STEP_M = 0.2
LOOK_M = np.arange(0.0, 3.05, LOOK_STEP_M)
"""Distances along a robot's path that are checked."""
BRAKING = np.array([0.0, 0.5, 1.0])
"""Shares of the others' stopping distance at which their bodies are checked."""
AHEAD_S = np.array([0.4, 0.9, 1.5])
"""Times ahead at which the others' bodies are checked, if their motion is known."""
MARGIN_M = 0.05
"""Least gap between envelopes."""
NO_NEARER_M = 0.002
"""Two that are already nearer may continue if they come nearer by at most this."""
BESIDE_M = 0.05
"""Extra width of a field on each side of the body."""
SIDESTEP_M = 0.12
"""Least gap to others after a sideways move."""
REACH_M = 7.0
"""Robots whose centres are further apart than this do not affect each other."""
EARLY_M = 2.5
"""How far beyond its stopping distance a robot checks."""
FLOOR_M = 1e5
"""Offset between floors, so that all floors can share one tree."""


@dataclass(frozen=True, slots=True, eq=False)
class Traffic:
    """The present state of n robots, as the others see them. Arrays are (n,)."""

    tracks: DriveTable
    progress_m: Floats
    speed_mps: Floats
    """Speed of progress; negative when backing."""
    brake_mps2: Floats
    backing: Bools
    going: Bools
    """Whether it drives or backs. The others need no free path."""
    aside_m: Floats
    """Offset to the left of the path."""
    floor: Ints
    length_m: Floats
    width_m: Floats
    ahead_m: Floats
    """Centre of the envelope ahead of the location."""
    fleet: Ints
    """Robots of one fleet know of each other."""
    person: Bools
    rank: Ints
    """Of two robots the one with the lower rank goes first."""
    first: Bools
    """Whether all others know where it drives and let it go first, except those of which that is true as well."""

    def braking_m(self) -> Floats:
        """(n,) stopping distance in progress if each braked now; negative when backing."""
        return self.speed_mps * np.abs(self.speed_mps) / (2 * self.brake_mps2)


@dataclass(frozen=True, slots=True, eq=False)
class FreeWays:
    """Free metres of progress ahead of each of n robots; behind it if it backs."""

    sensed_m: Floats
    """(n,) free path before its field would touch a robot of another fleet; inf if none is near."""
    sensed: Ints
    """(n,) that robot; `NOBODY` if none is near."""
    known_m: Floats
    """(n,) the same for its own fleet; for a person, for all robots."""
    known: Ints


def centres(traffic: Traffic, robots: Ints, progress_m: Floats) -> Floats:
    """(3, ...) x, y, yaw of the envelopes' centres."""
    x, y, yaw = traffic.tracks.poses(robots, progress_m)
    c, s = np.cos(yaw), np.sin(yaw)
    ahead_m, aside_m = traffic.ahead_m[robots], traffic.aside_m[robots]
    return np.stack([x + c * ahead_m - s * aside_m, y + s * ahead_m + c * aside_m, yaw])


def free_ways(traffic: Traffic) -> FreeWays:
    """The free path of every moving robot."""
    n = len(traffic.progress_m)
    free = FreeWays(np.full(n, np.inf), np.full(n, NOBODY), np.full(n, np.inf), np.full(n, NOBODY))
    who, whom = _near(traffic, traffic.going, EARLY_M)
    if not len(who):
        return free
    rows, at = np.unique(who, return_inverse=True)
    looks, everyone = _looks(traffic, rows, LOOK_M), np.arange(n)
    braking = _braking_places(traffic, everyone)
    later = _places(traffic, everyone, traffic.speed_mps[:, None] * AHEAD_S)
    meet = _boxes_meet(traffic, (rows[at], whom), looks[:, at], np.concatenate([braking, later], axis=2)[:, whom])
    who, whom, at = who[meet], whom[meet], at[meet]
    lets_go = traffic.first[whom] & ~traffic.first[who]
    knows = traffic.person[who] | (traffic.fleet[who] == traffic.fleet[whom]) | lets_go
    way_m = _way_m(traffic, who, whom, looks[:, at], braking[:, whom])
    foresees = knows & ((traffic.rank[whom] < traffic.rank[who]) | lets_go)
    who_known, whom_known = who[foresees], whom[foresees]
    foreseen_m = _way_m(traffic, who_known, whom_known, looks[:, at[foresees]], later[:, whom_known])
    way_m[foresees] = np.minimum(way_m[foresees], foreseen_m)
    for of_kind, free_m, by in ((~knows, free.sensed_m, free.sensed), (knows, free.known_m, free.known)):
        _keep_nearest(who[of_kind], whom[of_kind], way_m[of_kind], free_m, by)
    return free


def may_sidestep(traffic: Traffic, aside_m: Floats) -> Bools:
    """(n,) whether each can move sideways to `aside_m`: no robot is beside it there, over its whole stopping
    distance."""
    movers = traffic.aside_m != aside_m
    may = np.ones(len(movers), np.bool_)
    who, whom = _near(traffic, movers, SIDESTEP_M)
    if not len(who):
        return may
    along_m = traffic.braking_m()[who, None] * BRAKING
    places = _braking_places(traffic, whom)
    before, after = (
        _gaps_m(state, who, whom, _places(state, who, along_m), places)
        for state in (traffic, replace(traffic, aside_m=aside_m))
    )
    may[who[np.any((after < SIDESTEP_M) & (after < before), axis=(0, 2))]] = False
    return may


def _near(traffic: Traffic, asking: Bools, early_m: float) -> tuple[Ints, Ints]:
    """(p,) asking robots, and (p,) the others that they could come near to."""
    here = centres(traffic, np.arange(len(asking)), traffic.progress_m)
    tree = cKDTree(np.column_stack([here[0] + FLOOR_M * traffic.floor, here[1]]))
    pairs = tree.query_pairs(REACH_M, output_type="ndarray")
    both = np.concatenate([pairs, pairs[:, ::-1]])
    who, whom = both[asking[both[:, 0]]].T
    needs_m = np.hypot(traffic.length_m, traffic.width_m) / 2 + 1.5 * np.abs(traffic.braking_m())
    knows = traffic.person[who] | (traffic.fleet[who] == traffic.fleet[whom]) | traffic.first[whom]
    foreseen_m = np.where(knows, AHEAD_S[-1] * np.abs(traffic.speed_mps[whom]), 0.0)
    apart_m = np.hypot(here[0, who] - here[0, whom], here[1, who] - here[1, whom])
    near = apart_m < needs_m[who] + needs_m[whom] + foreseen_m + early_m
    return who[near], whom[near]


def _boxes_meet(traffic: Traffic, pairs: tuple[Ints, Ints], looks: Floats, places: Floats) -> Bools:
    """(p,) whether the bounding boxes of all that each of a pair may cover touch. `looks` and `places` are (3,
    p, k)."""
    radius_m = np.hypot(traffic.length_m, traffic.width_m) / 2 + BESIDE_M + MARGIN_M
    reach_m = radius_m[pairs[0]] + radius_m[pairs[1]]
    before = looks[:2].min(axis=2) - reach_m < places[:2].max(axis=2)
    beyond = looks[:2].max(axis=2) + reach_m > places[:2].min(axis=2)
    return np.all(before & beyond, axis=0)


def _looks(traffic: Traffic, who: Ints, along_m: Floats) -> Floats:
    direction = np.where(traffic.backing, -1.0, 1.0)[who, None]
    return _places(traffic, who, direction * along_m)


def _braking_places(traffic: Traffic, whom: Ints) -> Floats:
    return _places(traffic, whom, traffic.braking_m()[whom, None] * BRAKING)


def _places(traffic: Traffic, robots: Ints, along_m: Floats) -> Floats:
    """(3, p, k) centres of these robots after `along_m` (p, k) more on their paths."""
    return centres(traffic, robots[:, None], traffic.progress_m[robots, None] + along_m)


def _way_m(traffic: Traffic, who: Ints, whom: Ints, looks: Floats, places: Floats) -> Floats:
    """(p,) free progress of `who` before it would be within the margin of `whom`, and nearer than now."""
    gap_m = _gaps_m(traffic, who, whom, looks, places, BESIDE_M)
    blocked: Bools = (gap_m < MARGIN_M) & (gap_m < gap_m[:1] - NO_NEARER_M)
    reached = np.argmax(blocked, axis=0)[None]
    before, at = (np.take_along_axis(gap_m, np.maximum(rows, 0), axis=0)[0] for rows in (reached - 1, reached))
    share = np.clip((before - MARGIN_M) / np.maximum(before - at, 1e-9), 0.0, 1.0)
    way_m = LOOK_STEP_M * (np.maximum(reached[0] - 1, 0) + share)
    return np.where(np.any(blocked, axis=0), way_m, np.inf).min(axis=1)


def _gaps_m(traffic: Traffic, who: Ints, whom: Ints, looks: Floats, places: Floats, beside_m: float = 0.0) -> Floats:
    """(l, p, k) gaps of each look of `who`, which is (3, p, l), to each place of `whom`, (3, p, k)."""
    return gaps(
        looks.transpose(0, 2, 1)[:, :, :, None],
        places[:, None],
        (traffic.length_m[who, None], traffic.width_m[who, None] + 2 * beside_m),
        (traffic.length_m[whom, None], traffic.width_m[whom, None]),
    )


def _keep_nearest(who: Ints, whom: Ints, way_m: Floats, free_m: Floats, by: Ints) -> None:
    """Write the shortest free path of each robot, and the robot that ends it, into `free_m` and `by`."""
    order = np.lexsort((whom, way_m, who))
    rows, first = np.unique(who[order], return_index=True)
    nearest = order[first]
    free_m[rows] = way_m[nearest]
    by[rows] = np.where(np.isfinite(way_m[nearest]), whom[nearest], NOBODY)


def gaps(a: Floats, b: Floats, size_a: tuple[Floats, Floats], size_b: tuple[Floats, Floats]) -> Floats:
    """Largest separation of rectangles along the directions of their sides (separating axes): negative if they overlap,
    otherwise at most their distance. `a` and `b` are (3, ...) x, y, yaw of the centres.
    """
    dx, dy, turn = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    found = []
    for yaw, (long, wide), (other_long, other_wide) in ((a[2], size_a, size_b), (b[2], size_b, size_a)):
        cy, sy = np.cos(yaw), np.sin(yaw)
        found.append(np.abs(dx * cy + dy * sy) - (long + c * other_long + s * other_wide) / 2)
        found.append(np.abs(dy * cy - dx * sy) - (wide + s * other_long + c * other_wide) / 2)
    return np.maximum(np.maximum(found[0], found[1]), np.maximum(found[2], found[3]))
