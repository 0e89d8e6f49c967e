"""The places where robots lose the most time, each with its cause and what is known to help.

Pure: the sums and the places of the site in; at most five places out. A place is one that the site file names; a queue
belongs to the resource near which it stands, and what is lost elsewhere to a square of the floor. The cause follows
from the kinds of its losses, what it is, and which way each vendor drives there. What robots lose in a queue, or behind
others, follows from what the first of them loses, and tells nothing.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

from deconflict.operator.suggestions.evidence import CellLoss, LossEvidence, PairLoss, Passes, PlaceKey
from deconflict.operator.suggestions.place_rules import (
    CROSSINGS,
    DOCK_SAVES,
    LEAST_LOSSES,
    MEETINGS,
    ONE_WAY_SAVES,
    PRIORITY_SAVES,
    QUEUES,
    QUEUES_OF_NEAR,
    is_enough,
    is_steady,
    nearest_served,
    rate,
    saved,
    saving_of,
)
from deconflict.operator.suggestions.suggested_places import SuggestedPlaces
from deconflict.operator.suggestions.suggestion import expected_s, minutes, whatif_command
from deconflict_client.answers.suggestion_models import (
    ChangeKind,
    LossCause,
    SuggestionEvidence,
    TriedChange,
    WorstPlace,
)

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


MOST_PLACES = 5
SQUARE_M = 10.0
"""What is lost outside all places is summed by squares of this side."""
LEAST_S = 100.0
"""A place with less is not among the worst, however little is lost elsewhere."""
SAVES: dict[ChangeKind, tuple[float, float]] = {
    "dock": DOCK_SAVES,
    "one_way": ONE_WAY_SAVES,
    "order": PRIORITY_SAVES,
    "priority": PRIORITY_SAVES,
}
"""Shares of what is lost. A lane that can't be simulated is not said to be better wider."""
NOTHING_PAYS = "nothing found that pays"
TOO_LITTLE = "Too little is lost for an expectation of what would help."
TOO_FEW = "Too few losses yet ({losses}) for an expectation of what would help."
UNKNOWN = "No change of the floor is known that would help."


class LossSpot(NamedTuple):
    """A named place, or a square of a floor."""

    key: PlaceKey
    square: tuple[int, int] | None = None


def worst_places(evidence: LossEvidence, places: SuggestedPlaces, since_s: float) -> list[WorstPlace]:
    """At most five, the worst first, with the change that the rules expect to help."""
    cells_of: dict[LossSpot, list[CellLoss]] = {}
    for cell in evidence.cells:
        if cell.lost_s > 0:
            cells_of.setdefault(_spot(cell, places), []).append(cell)
    worst = sorted(cells_of.items(), key=lambda entry: -sum(cell.lost_s for cell in entry[1]))[:MOST_PLACES]
    return [
        _worst_place(spot, cells, evidence, places, since_s)
        for spot, cells in worst
        if sum(cell.lost_s for cell in cells) >= LEAST_S
    ]


def with_tried(found: WorstPlace, tried: Sequence[TriedChange]) -> WorstPlace:
    """The place after changes were simulated. If the simulation answers none of them, the rule still stands."""
    answered = [change for change in tried if change.saving]
    paying = (change for change in answered if change.pays)
    best = max(paying, key=lambda change: expected_s(change.saving), default=None)
    return _told(found.model_copy(update={"tried": list(tried), "best": best if answered else found.best}))


def changes_of(found: WorstPlace, evidence: LossEvidence, places: SuggestedPlaces) -> Iterable[TriedChange]:
    """What may help against the cause of a place, without what it saves."""
    vendor = _losing_vendor(evidence, found.place, places.people)
    commands: dict[ChangeKind, tuple[str, tuple[str, ...]]] = {
        "dock": (f"one more beside {found.place}", ("--dock", found.place)),
        "one_way": (f"{found.place} one-way", ("--one-way", found.place)),
        "widen": (f"{found.place} wider", ("--widen", found.place)),
        "order": (f"{found.place} entered from one side at a time", ("--order", found.place)),
        "priority": (f"the robots of {vendor} first everywhere", ("--priority", vendor)),
    }
    for kind in CHANGES[found.cause] if found.place else ():
        change, options = commands[kind]
        if all(options):
            yield TriedChange(kind=kind, subject=options[1], change=change, check=whatif_command(*options), saving=None)


def _losing_vendor(evidence: LossEvidence, place: str, people: Iterable[str]) -> str:
    """The vendor that loses most to others where it crosses them at a place; "" if none does."""
    sums = Counter[str]()
    for pair in evidence.pairs:
        if pair.key.place == place and pair.kind in (*CROSSINGS, "deadlock") and pair.vendor != pair.by:
            sums[pair.vendor] += pair.lost_s  # type: ignore[assignment]
    return max(sums.keys() - set(people), key=lambda vendor: (sums[vendor], vendor), default="")


def _worst_place(
    spot: LossSpot, cells: list[CellLoss], evidence: LossEvidence, places: SuggestedPlaces, since_s: float
) -> WorstPlace:
    kinds = Counter[str]()
    for cell in cells:
        kinds[cell.kind] += cell.lost_s  # type: ignore[assignment]
    worst, passes = max(cells, key=lambda cell: cell.lost_s), evidence.passes.get(spot.key, {})
    keys = {cell.key for cell in cells}
    pairs = [pair for pair in evidence.pairs if pair.key in keys and pair.kind in kinds]
    figures = evidence.of_cells(cells, pairs)
    found = WorstPlace(
        floor=spot.key.floor,
        place=spot.key.place,
        x_m=worst.x_m,
        y_m=worst.y_m,
        cause=cause_of(
            kinds,
            passes,
            is_aisle=spot.key in places.aisles,
            is_served=any(served.name == spot.key.place for served in places.served),
            is_crossing=spot.key in places.crossings,
        ),
        evidence=figures,
        kinds={kind: round(lost_s / evidence.hours, 1) for kind, lost_s in kinds.most_common()},
        turned=turned_vendors(passes),
        since_s=since_s,
    )
    of_robots = _without_people(figures, evidence, pairs, places.people)
    is_worth = is_enough(of_robots) and is_steady(evidence, keys)
    changes = changes_of(found, evidence, places) if is_worth else ()
    return _told(found.model_copy(update={"best": _expected(next(iter(changes), None), of_robots)}))


def _without_people(
    figures: SuggestionEvidence, evidence: LossEvidence, pairs: Sequence[PairLoss], people: Collection[str]
) -> SuggestionEvidence:
    """The figures of a place without what people lose to people, which a change for robots does not save."""
    among_people = evidence.of_pairs([pair for pair in pairs if {pair.vendor, pair.by} <= set(people)])
    return figures.model_copy(
        update={
            "lost_s_per_hour": max(figures.lost_s_per_hour - among_people.lost_s_per_hour, 0.0),
            "share": max(figures.share - among_people.share, 0.0),
            "losses": max(figures.losses - among_people.losses, 0),
        }
    )


def _expected(change: TriedChange | None, figures: SuggestionEvidence) -> TriedChange | None:
    """A change with what the rules expect of it."""
    return change and change.model_copy(update={"saving": saving_of(figures, SAVES[change.kind])})


def _told(found: WorstPlace) -> WorstPlace:
    """The place with its sentences."""
    name = found.place or f"Around {found.x_m:.0f}, {found.y_m:.0f} m"
    why = SENTENCES[found.cause].format(turned=" and ".join(found.turned))
    tried = f"Tried: {'; '.join(map(_tried, found.tried))}." if found.tried else "Nothing was tried yet."
    sentences = f"{name}: robots lose {rate(found.evidence)}, because {why}.", tried, _best(found)
    return found.model_copy(update={"text": " ".join(sentences)})


def _best(found: WorstPlace) -> str:
    """The sentence on what is best, or expected to be, or why there is nothing."""
    if found.best and found.best.saving:
        if found.tried:
            return f"Best: {found.best.change}, which would save {saved(found.best.saving)}."
        if found.best.saving.low_s_per_hour > 0:
            return f"Expected to help: {found.best.change}, which would save {saved(found.best.saving)}."
        most = minutes(found.best.saving.high_s_per_hour)
        return f"Simulate this first: {found.best.change}. It may save up to {most} an hour, or lose time."
    if found.tried:
        return f"{NOTHING_PAYS.capitalize()}."
    if not (CHANGES[found.cause] and found.place):
        return UNKNOWN
    is_few = found.evidence.losses < LEAST_LOSSES
    return TOO_FEW.format(losses=found.evidence.losses) if is_few else TOO_LITTLE


def _tried(change: TriedChange) -> str:
    if change.saving is None:
        return f"{change.change}: not simulated, since {change.note}"
    low, high = change.saving.low_s_per_hour, change.saving.high_s_per_hour
    if change.pays:
        return f"{change.change}: saves {saved(change.saving)}"
    return f"{change.change}: {'loses time' if high < 0 else 'no clear change'} ({low:+.0f} to {high:+.0f} s an hour)"


def _spot(cell: CellLoss, places: SuggestedPlaces) -> LossSpot:
    waits = cell.kind in QUEUES and cell.key not in places.aisles | places.crossings
    served = nearest_served(cell, places.served) if waits else None
    if served:
        return LossSpot(PlaceKey(cell.key.floor, served.name))
    is_named = bool(cell.key.place)
    return LossSpot(cell.key, None if is_named else (int(cell.x_m // SQUARE_M), int(cell.y_m // SQUARE_M)))
