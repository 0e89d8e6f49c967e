"""How far each robot can go on its way before its field would touch another, and who it would be.

A field is the body, a little wider, along the robot's own way. It has to stay clear of the bodies of others, and of
what they would still cover if they braked now: so two that both brake never touch. Of its own fleet, or of everybody
if it is a person, a robot knows more: of two, the one of the later rank keeps off the way that the other takes in the
next second and a half.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from deconflict.simulation.driving.drive_table import Tracks
from ingest.batch import Floats, Ints

NOBODY = -1
LOOK_STEP_M = 0.2
LOOK_M = np.arange(0.0, 3.05, LOOK_STEP_M)
"""Places along a robot's way that are tried."""
BRAKING = np.array([0.0, 0.5, 1.0])
"""Shares of the others' stopping distance at which their bodies are looked at."""
AHEAD_S = np.array([0.4, 0.9, 1.5])
"""When the others' places are looked at, where they are known."""
MARGIN_M = 0.05
"""Envelopes are not brought nearer than this."""
NO_NEARER_M = 0.002
"""Two that are nearer already may go on where they come no nearer than by this."""
BESIDE_M = 0.05
"""How much wider than its body a field is on each side."""
SIDESTEP_M = 0.12
"""Nobody goes sideways to where another would be nearer than this."""
REACH_M = 7.0
"""Robots whose centres are further apart than this do not matter to each other."""
EARLY_M = 2.5
"""How much further than its stopping distance a robot looks."""
FLOOR_M = 1e5
"""Apart by this, floors share one tree."""

Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Traffic:
    """n robots as the others meet them."""

    tracks: Tracks
    progress_m: Floats
    speed_mps: Floats
    """Of progress; negative when backing."""
    brake_mps2: Floats
    backing: Bools
    going: Bools
    """Who drives or backs: the others need no way."""
    aside_m: Floats
    """To the left of the way."""
    floor: Ints
    length_m: Floats
    width_m: Floats
    ahead_m: Floats
    """Centre of the envelope ahead of the location."""
    fleet: Ints
    """Robots of one fleet are told of each other."""
    person: Bools
    rank: Ints
    """The lower of two goes first."""

    def braking_m(self) -> Floats:
        """(n,) progress until each would stand if it braked now; negative when backing."""
        way_m: Floats = self.speed_mps * np.abs(self.speed_mps) / (2 * self.brake_mps2)
        return way_m


@dataclass(frozen=True, slots=True, eq=False)
class Free:
    """Metres of progress that are free ahead of each of n robots (behind, when it backs)."""

    sensed_m: Floats
    """(n,) before its field would touch somebody of another fleet; inf where nobody is near."""
    sensed: Ints
    """(n,) who that is; `NOBODY` where nobody is near."""
    known_m: Floats
    """(n,) the same of its own fleet; of everybody if it is a person."""
    known: Ints


def centres(traffic: Traffic, robots: Ints, progress_m: Floats) -> Floats:
    """(3, ...) x, y, yaw of the envelopes' centres."""
    x, y, yaw = traffic.tracks.poses(robots, progress_m)
    c, s = np.cos(yaw), np.sin(yaw)
    ahead_m, aside_m = traffic.ahead_m[robots], traffic.aside_m[robots]
    return np.stack([x + c * ahead_m - s * aside_m, y + s * ahead_m + c * aside_m, yaw])


def free_ways(traffic: Traffic) -> Free:
    """How far everybody that is going can go."""
    n = len(traffic.progress_m)
    free = Free(np.full(n, np.inf), np.full(n, NOBODY), np.full(n, np.inf), np.full(n, NOBODY))
    who, whom = _near(traffic, traffic.going, EARLY_M)
    if not len(who):
        return free
    rows, at = np.unique(who, return_inverse=True)
    looks, everyone = _looks(traffic, rows, LOOK_M), np.arange(n)
    braking = _braking_places(traffic, everyone)
    later = _places(traffic, everyone, traffic.speed_mps[:, None] * AHEAD_S)
    meet = _boxes_meet(traffic, (rows[at], whom), looks[:, at], np.concatenate([braking, later], axis=2)[:, whom])
    who, whom, at = who[meet], whom[meet], at[meet]
    knows = traffic.person[who] | (traffic.fleet[who] == traffic.fleet[whom])
    way_m = _way_m(traffic, who, whom, looks[:, at], braking[:, whom])
    foresees = knows & (traffic.rank[whom] < traffic.rank[who])
    who_known, whom_known = who[foresees], whom[foresees]
    foreseen_m = _way_m(traffic, who_known, whom_known, looks[:, at[foresees]], later[:, whom_known])
    way_m[foresees] = np.minimum(way_m[foresees], foreseen_m)
    for of_kind, free_m, by in ((~knows, free.sensed_m, free.sensed), (knows, free.known_m, free.known)):
        _keep_nearest(who[of_kind], whom[of_kind], way_m[of_kind], free_m, by)
    return free


def may_sidestep(traffic: Traffic, aside_m: Floats) -> Bools:
    """(n,) whether nobody is beside those who mean to be at `aside_m` next, on all the way that braking takes."""
    movers = traffic.aside_m != aside_m
    may = np.ones(len(movers), np.bool_)
    who, whom = _near(traffic, movers, SIDESTEP_M)
    if not len(who):
        return may
    along_m = traffic.braking_m()[who, None] * BRAKING
    places = _braking_places(traffic, whom)
    before, after = (
        _gaps_m(one, who, whom, _places(one, who, along_m), places)
        for one in (traffic, replace(traffic, aside_m=aside_m))
    )
    may[who[np.any((after < SIDESTEP_M) & (after < before), axis=(0, 2))]] = False
    return may


def _near(traffic: Traffic, asking: Bools, early_m: float) -> tuple[Ints, Ints]:
    """Pairs (p,) of those who ask and others that they could come near to, both ways round."""
    here = centres(traffic, np.arange(len(asking)), traffic.progress_m)
    tree = cKDTree(np.column_stack([here[0] + FLOOR_M * traffic.floor, here[1]]))
    pairs = tree.query_pairs(REACH_M, output_type="ndarray")
    both = np.concatenate([pairs, pairs[:, ::-1]])
    who, whom = both[asking[both[:, 0]]].T
    needs_m = np.hypot(traffic.length_m, traffic.width_m) / 2 + 1.5 * np.abs(traffic.braking_m())
    foreseen_m = np.where(traffic.fleet[who] == traffic.fleet[whom], AHEAD_S[-1] * np.abs(traffic.speed_mps[whom]), 0.0)
    foreseen_m[traffic.person[who]] = AHEAD_S[-1] * np.abs(traffic.speed_mps[whom[traffic.person[who]]])
    apart_m = np.hypot(here[0, who] - here[0, whom], here[1, who] - here[1, whom])
    near = apart_m < needs_m[who] + needs_m[whom] + foreseen_m + early_m
    return who[near], whom[near]


def _boxes_meet(traffic: Traffic, pairs: tuple[Ints, Ints], looks: Floats, places: Floats) -> Bools:
    """(p,) whether boxes around all that each of a pair may cover touch; `looks` and `places` are (3, p, k)."""
    radius_m = np.hypot(traffic.length_m, traffic.width_m) / 2 + BESIDE_M + MARGIN_M
    reach_m = radius_m[pairs[0]] + radius_m[pairs[1]]
    before = looks[:2].min(axis=2) - reach_m < places[:2].max(axis=2)
    beyond = looks[:2].max(axis=2) + reach_m > places[:2].min(axis=2)
    meet: Bools = np.all(before & beyond, axis=0)
    return meet


def _looks(traffic: Traffic, who: Ints, along_m: Floats) -> Floats:
    direction = np.where(traffic.backing, -1.0, 1.0)[who, None]
    return _places(traffic, who, direction * along_m)


def _braking_places(traffic: Traffic, whom: Ints) -> Floats:
    return _places(traffic, whom, traffic.braking_m()[whom, None] * BRAKING)


def _places(traffic: Traffic, robots: Ints, along_m: Floats) -> Floats:
    """(3, p, k) centres of these robots so far along their ways from where they are; `along_m` is (p, k)."""
    return centres(traffic, robots[:, None], traffic.progress_m[robots, None] + along_m)


def _way_m(traffic: Traffic, who: Ints, whom: Ints, looks: Floats, places: Floats) -> Floats:
    """(p,) progress that `who` has before it would come within the margin of `whom`, and nearer than it is."""
    gap_m = _gaps_m(traffic, who, whom, looks, places, BESIDE_M)
    blocked: Bools = (gap_m < MARGIN_M) & (gap_m < gap_m[:1] - NO_NEARER_M)
    reached = np.argmax(blocked, axis=0)[None]
    before, at = (np.take_along_axis(gap_m, np.maximum(rows, 0), axis=0)[0] for rows in (reached - 1, reached))
    share = np.clip((before - MARGIN_M) / np.maximum(before - at, 1e-9), 0.0, 1.0)
    way_m = LOOK_STEP_M * (np.maximum(reached[0] - 1, 0) + share)
    nearest_m: Floats = np.where(np.any(blocked, axis=0), way_m, np.inf).min(axis=1)
    return nearest_m


def _gaps_m(traffic: Traffic, who: Ints, whom: Ints, looks: Floats, places: Floats, beside_m: float = 0.0) -> Floats:
    """(l, p, k) gaps of each look of `who`, which is (3, p, l), to each place of `whom`, (3, p, k)."""
    return gaps(
        looks.transpose(0, 2, 1)[:, :, :, None],
        places[:, None],
        (traffic.length_m[who, None], traffic.width_m[who, None] + 2 * beside_m),
        (traffic.length_m[whom, None], traffic.width_m[whom, None]),
    )


def _keep_nearest(who: Ints, whom: Ints, way_m: Floats, free_m: Floats, by: Ints) -> None:
    """Write the shortest free way of each robot, and who ends it, into `free_m` and `by`."""
    order = np.lexsort((whom, way_m, who))
    rows, first = np.unique(who[order], return_index=True)
    nearest = order[first]
    free_m[rows] = way_m[nearest]
    by[rows] = np.where(np.isfinite(way_m[nearest]), whom[nearest], NOBODY)


def gaps(a: Floats, b: Floats, size_a: tuple[Floats, Floats], size_b: tuple[Floats, Floats]) -> Floats:
    """Largest separation of rectangles along the directions of their sides: negative where they overlap,
    else at most their distance (separating axes). `a` and `b` are (3, ...) x, y, yaw of the centres.
    """
    dx, dy, turn = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    found = []
    for yaw, (long, wide), (other_long, other_wide) in ((a[2], size_a, size_b), (b[2], size_b, size_a)):
        cy, sy = np.cos(yaw), np.sin(yaw)
        found.append(np.abs(dx * cy + dy * sy) - (long + c * other_long + s * other_wide) / 2)
        found.append(np.abs(dy * cy - dx * sy) - (wide + s * other_long + c * other_wide) / 2)
    largest: Floats = np.maximum(np.maximum(found[0], found[1]), np.maximum(found[2], found[3]))
    return largest
