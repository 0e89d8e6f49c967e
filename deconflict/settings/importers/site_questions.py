"""The few questions about a new site that robots can't answer."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

Ask = Callable[[str, str], str]
"""Asks a person a question. Returns the answer, or the second argument if it is empty."""


@dataclass(frozen=True, slots=True)
class SiteAnswers:
    """What a person said about a new site."""

    name: str = "My site"
    clearance_m: float | None = None
    """None for the default."""
    floor_names: Mapping[str, str] = field(default_factory=dict)
    """By datum."""
    people: frozenset[str] = frozenset()
    """Vendors whose robots are people with devices."""
    expected: tuple[str, ...] = ()
    """Vendors that were not heard."""


def asked(ask: Ask, vendors: Iterable[str], datums: Iterable[str]) -> SiteAnswers:
    """The answers about a site, of which these vendors and site datums were heard."""
    heard = sorted(vendors)
    name = ask("Name of the site", SiteAnswers().name)
    clearance_m = _number(ask, "Robots nearer than this are in conflict, in metres", "0.3")
    floor_names = {datum: ask(f"Name of the floor whose datum is {datum}", "Ground floor") for datum in datums}
    more = "Vendors that were not heard" if heard else "No robot was heard. Names of the vendors"
    expected = tuple(filter(None, (vendor.strip() for vendor in ask(f"{more}, separated by commas", "").split(","))))
    yes = {"y", "yes"}
    people = frozenset(
        vendor
        for vendor in (*heard, *expected)
        if ask(f"Are those of {vendor} people with devices, y or n", "n").casefold() in yes
    )
    return SiteAnswers(name, clearance_m, floor_names, people, expected)


def _number(ask: Ask, question: str, default: str) -> float:
    hint = ""
    while True:
        answer = ask(hint + question, default)
        try:
            value = float(answer.replace(",", "."))
        except ValueError:
            value = 0.0
        if 0 < value < 100:
            return value
        hint = f"{answer!r} is no number from 0 to 100. "
