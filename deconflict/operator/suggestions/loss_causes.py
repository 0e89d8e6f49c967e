"""Why robots lose time at a place, from the kinds of its losses, what it is, and which way each vendor drives there.

Pure. What robots lose in a queue, or behind others, follows from what the first of them loses, and tells nothing.
"""

from collections.abc import Mapping

from deconflict.operator.suggestions.evidence import Passes
from deconflict.operator.suggestions.place_rules import CROSSINGS, MEETINGS, QUEUES, QUEUES_OF_NEAR
from deconflict_client.answers.suggestion_models import ChangeKind, LossCause

FOLLOW = ("queue", "following")
MOST = 0.5
"""Of what tells something: a cause has so much of it."""
ONE_DIRECTION = 0.9
"""A vendor whose robots drive so many of their passes in one direction has a one-way there."""
LEAST_PASSES = 3
CHANGES: dict[LossCause, tuple[ChangeKind, ...]] = {
    "narrow_lane": ("one_way", "widen", "order"),
    "opposed_one_way": ("one_way",),
    "few_resources": ("dock",),
    "unordered_crossing": ("order", "priority"),
    "standing_robot": (),
    "mixed": (),
}
"""What may help against each cause; what usually helps most first."""
SENTENCES: dict[LossCause, str] = {
    "narrow_lane": "robots that come from both ends meet where there is no room to pass",
    "opposed_one_way": "each vendor drives one way only, but {turned} the other way than the rest",
    "few_resources": "robots queue for it: there are fewer of it than are needed",
    "unordered_crossing": "robots cross without an order, and stand for each other",
    "standing_robot": "robots that stand for nobody block the way",
    "mixed": "robots are in each other's way for several reasons, none of which stands out",
}


def cause_of(
    kinds: Mapping[str, float], passes: Mapping[str, Passes], *, is_aisle: bool, is_served: bool, is_crossing: bool
) -> LossCause:
    """The cause of what is lost at a place, by kind of loss."""
    if is_served and _share(kinds, kinds, QUEUES) >= QUEUES_OF_NEAR:
        return "few_resources"
    telling = [kind for kind in kinds if kind not in FOLLOW]
    if _share(kinds, telling, (*MEETINGS, *(CROSSINGS if is_crossing else ()))) >= MOST and is_crossing:
        return "unordered_crossing"
    if _share(kinds, telling, MEETINGS) >= MOST and is_aisle:
        return "opposed_one_way" if turned_vendors(passes) else "narrow_lane"
    if _share(kinds, telling, ("head_on",)) >= MOST:
        return "narrow_lane"
    if _share(kinds, telling, (*CROSSINGS, "deadlock")) >= MOST:
        return "unordered_crossing"
    return "standing_robot" if _share(kinds, telling, ("blockage",)) >= MOST else "mixed"


def turned_vendors(passes: Mapping[str, Passes]) -> list[str]:
    """The vendors whose robots drive an aisle the other way than most, if each vendor drives one way only."""
    known = {vendor: found for vendor, found in passes.items() if sum(found) >= LEAST_PASSES}
    if not known or any(max(found) < ONE_DIRECTION * sum(found) for found in known.values()):
        return []
    along = sum(found.along for found in known.values())
    is_along = 2 * along >= sum(map(sum, known.values()))
    return sorted(vendor for vendor, found in known.items() if (found.along > found.against) != is_along)


def _share(kinds: Mapping[str, float], of: "Mapping[str, float] | list[str]", chosen: tuple[str, ...]) -> float:
    return sum(kinds[kind] for kind in of if kind in chosen) / max(sum(kinds[kind] for kind in of), 1e-9)
