from itertools import pairwise

from ingest.batch import Claim
from ingest.fleet.owners.ownership_claims import (
    HELD_S,
    JUMPS,
    MOST_CLAIMS,
    MOST_COUNTED,
    MOST_WATCHED,
    NAMED_ROBOTS,
    OwnershipClaims,
)
from ingest.fleet.prediction.forecast_model import Sighting

NOW_S = 1_790_000_000.0


def at(t_s: float, x_m: float, floor: int = 0) -> Sighting:
    return Sighting(NOW_S + t_s, floor, x_m, 0.0, 0.0, 1.0, 0.0)


def seen(*sightings: Sighting) -> tuple[Claim, ...]:
    """The claims that stand after a robot was reported so, each report on its own time."""
    claims = OwnershipClaims()
    for before, now in pairwise(sightings):
        claims.add_sighting("r", "Alder", before, now, now.t_s - before.t_s, now.t_s)
    return claims.standing(sightings[-1].t_s)


def test_a_refused_report_stands_until_none_has_come_for_a_while() -> None:
    claims = OwnershipClaims()
    claims.add("r", "Alder", "Mallory", NOW_S)
    claims.add("s", "Alder", "Mallory", NOW_S + 5)
    claim = Claim("Alder", "Mallory", ("r", "s"), 2, NOW_S)
    assert claims.standing(NOW_S + 5 + HELD_S) == (claim,)
    assert claims.standing(NOW_S + 5.1 + HELD_S) == ()


def test_a_robot_that_jumps_three_times_is_in_two_places() -> None:
    (claim,) = seen(*(at(t / 2, 40.0 * (t % 2)) for t in range(JUMPS + 1)))
    assert claim == Claim("Alder", "Alder", ("r",), 1, NOW_S + JUMPS / 2)


def test_a_change_of_floor_is_a_jump() -> None:
    assert seen(*(at(t, 0.0, floor=t % 2) for t in range(JUMPS + 1)))


def test_a_possible_motion_makes_no_claim() -> None:
    drives = [at(t, 3.0 * t) for t in range(10)]
    was_found = [at(0, 0.0), at(1, 60.0), at(2, 61.0), at(3, 62.0), at(4, 63.0)]
    by_lift = [at(0, 0.0), at(20, 0.0, floor=1), at(40, 0.0), at(60, 0.0, floor=1)]
    delayed = [at(8.0 * t, 60.0 * (t % 2)) for t in range(6)]
    assert [seen(*sightings) for sightings in (drives, was_found, by_lift, delayed)] == [()] * 4


def test_clocks_hours_apart_do_not_hide_a_robot_in_two_places() -> None:
    claims = OwnershipClaims()
    there, here = at(0, 0.0), at(7200, 500.0)
    for t in range(JUMPS):
        before, now = (there, here) if t % 2 else (here, there)
        claims.add_sighting("r", "Alder", before, now, 0.5, NOW_S + t / 2)
    assert claims.standing(NOW_S + 2)


def test_claims_are_bounded_whatever_is_claimed() -> None:
    claims = OwnershipClaims()
    for i in range(2 * MOST_COUNTED):
        claims.add(f"r{i}", "Alder", "Mallory", NOW_S)
        claims.add("r", "Alder", f"Mallory {i}", NOW_S)
    standing = claims.standing(NOW_S)
    assert len(standing) == MOST_CLAIMS
    (much,) = [claim for claim in standing if claim.claimant == "Mallory"]
    assert (len(much.robots), much.claimed) == (NAMED_ROBOTS, MOST_COUNTED)
    assert much.robots[0] == "r0"


def test_beyond_the_limit_robots_that_jumped_longest_ago_are_forgotten() -> None:
    claims, there, here = OwnershipClaims(), at(0, 0.0), at(0, 500.0)
    for uuid in ["r"] * (JUMPS - 1) + ["s"] * (JUMPS - 1) + [f"r{i}" for i in range(MOST_WATCHED - 1)] + ["r", "s"]:
        claims.add_sighting(uuid, "Alder", there, here, 0.5, NOW_S)
    assert [claim.robots for claim in claims.standing(NOW_S)] == []
    for uuid in ("t", "t", "t"):
        claims.add_sighting(uuid, "Alder", there, here, 0.5, NOW_S)
    assert [claim.robots for claim in claims.standing(NOW_S)] == [("t",)]
