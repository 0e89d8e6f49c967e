"""What advisories on all but conflicts say. `Named` gives the name of a robot by its UUID, or of a place by its id."""

from collections.abc import Callable, Collection, Sequence

from deconflict.advice.actions.action_text import action_text
from deconflict.advice.document_limits import MOST_NAMED, listed
from deconflict.advisories.words.words import RevisionWords, each_waits, words
from deconflict_client.advisory import Recommendation
from deconflict_client.counted_nouns import count_of

Named = Callable[[str], str]
WIDE_SPREAD_S = 3.0
"""The text gives the spread of an arrival if it is at least so wide."""


def contention(
    names: Sequence[str], label: str, left_s: float, spread_s: float, wait_s: float, free_s: float, advised: list[str]
) -> RevisionWords:
    """Robots will want a place that comes free in `free_s`; the arrival of the first may be off by `spread_s`."""
    spread = f", give or take {spread_s:.0f} s," if spread_s >= WIDE_SPREAD_S else ""
    free = [f"it comes free in {free_s:.0f} s"] if free_s > 0 else []
    return words(
        lambda when: f"{shortened(names)} will find {label} taken{when} and wait up to {wait_s:.0f} s",
        f" {_when(left_s)}{spread}",
        *free,
        *advised,
    )


def advised_slots(
    advice: Recommendation | None, place: str, coming: Collection[str], name: Named, label: Named
) -> list[str]:
    """What a site service should do; if no order or place saves time, who should come later."""
    if advice is None:
        return []
    if advice.expected_saving_s < 1:
        late = [slot for slot in advice.slots if slot.robot in coming and slot.wait_s >= 1]
        return [f"{name(slot.robot)} should come {slot.wait_s:.0f} s later" for slot in late[:2]]
    elsewhere = [slot for slot in advice.slots if slot.resource != place and slot.robot in coming]
    phrases = [f"{name(slot.robot)} should take {label(slot.resource)}" for slot in elsewhere]
    first = next((slot for slot in advice.slots if slot.resource == place and slot.robot in coming), None)
    if not phrases and first:
        phrases = [f"{name(first.robot)} should go first"]
    saving = f", which saves {advice.expected_saving_s:.0f} s in all"
    return [*phrases[:2][:-1], *(phrase + saving for phrase in phrases[:2][-1:])]


def shortage(chargers: str, left_s: float, expected: Sequence[tuple[str, float]]) -> RevisionWords:
    """Chargers that will be full, and the names and levels in percent of those who will need one."""
    levels = ", ".join(f"{name} {level_pct:.0f} %" for name, level_pct in expected[:4])
    who = shortened([name for name, _ in expected])
    return words(
        lambda when: (
            f"{chargers} will probably be full{when}: {who} will need to be charged by then, "
            f"by the level of their batteries ({levels})"
        ),
        f" {_when(left_s)}",
    )


def double_occupancy(inside: int, label: str, capacity: int) -> RevisionWords:
    """More robots are in a place than its capacity."""
    return words(lambda _: f"{inside} robots are in {label}, which takes {capacity}")


def deadlock(names: Sequence[str], labels: Sequence[str], left_s: float, way_out: list[str]) -> RevisionWords:
    """Robots lock each other at places, or will."""
    more = ["others"] * (len(labels) > MOST_NAMED)
    place = f" at {' and '.join([*labels[:MOST_NAMED], *more])}" if labels else ""
    lock, when = ("lock", "") if left_s <= 0 else ("will lock", f" {_when(left_s)}")
    return words(
        lambda when: f"{shortened(names)} {lock} each other{place}{when}: {each_waits(len(names))}", when, *way_out
    )


def mutual_wait(names: Sequence[str], stood_s: float, first: str) -> RevisionWords:
    """Robots stand before a free crossing, each for the other."""
    return words(
        lambda when: f"{shortened(names)} have stood{when} before a free crossing: each waits for the other",
        f" for {stood_s:.0f} s",
        f"{first} should go first",
    )


def way_out(advice: Recommendation | None, places: Collection[str], name: Named, label: Named) -> list[str]:
    """What ends a ring of waits at some places."""
    if advice is None or advice.note or not advice.slots:
        return [advice.note] if advice and advice.note else []
    first = advice.slots[0]
    if first.resource not in places:
        costs = f", which costs {advice.cost_s:.0f} s in all"
        return [f"{name(first.robot)} should go to {label(first.resource)} first{costs}"]
    last = max(advice.slots, key=lambda slot: slot.wait_s)
    return [f"{name(last.robot)} should wait {last.wait_s:.0f} s before {label(last.resource)}"]


def blockage(name: str, state: str, stood_s: float, held_up: Sequence[str], advice: Recommendation) -> RevisionWords:
    """A robot stands in the way of others."""
    return words(
        lambda when: f"{name} has stood{when} ({state}) in the way of {shortened(held_up)}",
        f" for {stood_s:.0f} s",
        *map(action_text, advice.actions),
    )


def crowd(count: int, label: str, x_m: float, y_m: float, first_names: Sequence[str]) -> RevisionWords:
    """Robots report from one place."""
    return words(
        lambda _: (
            f"{count} robots of {label} report from one place, around ({round(x_m)}, {round(y_m)}) m: "
            f"{', '.join(first_names)} and {count_of(count - len(first_names), 'other')}"
        ),
        "",
        "check their localisation, as no conflicts among them are reported",
    )


def claim(owner: str, claimant: str, claimed: int, first_names: Sequence[str]) -> RevisionWords:
    """A vendor reports robots of another one, or its own from two places."""
    others = claimed - len(first_names)
    robots = f"{', '.join(first_names)} and {count_of(others, 'other')}" if others > 0 else ", ".join(first_names)
    if owner != claimant:
        return words(lambda _: f"{claimant} reports {robots} of {owner}: refused", "", "see GET /quarantine")
    reported = f"{robots} of {owner}: reported from two places at once"
    return words(lambda _: reported, "", "two robots may have one UUID")


def shortened(names: Sequence[str]) -> str:
    """At most four names, or three and how many more."""
    return listed(names if len(names) <= 4 else [*names[:3], f"{len(names) - 3} others"])


def _when(left_s: float) -> str:
    return f"in {left_s:.0f} s" if left_s >= 1 else "now"
