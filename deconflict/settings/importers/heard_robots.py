"""A first site file from robots that were heard: vendors, datums and models, with the readings still to be measured."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from deconflict.settings.importers.site_questions import SiteAnswers
from deconflict.settings.importers.toml_values import toml_value
from deconflict_client.counted_nouns import count_of
from deconflict_client.participant_kinds import NOUNS
from ingest.languages.visible_text import visible
from ingest.settings import NIL_DATUM

RobotDocument = Mapping[str, Any]
"""A robot as `GET /robots` has it."""


class HeardRobots:
    """Robots by vendor and by datum."""

    def __init__(self, robots: Iterable[RobotDocument]) -> None:
        self.by_vendor: defaultdict[str, list[RobotDocument]] = defaultdict(list)
        for robot in sorted(robots, key=lambda each: str(each["name"])):
            self.by_vendor[robot["vendor"]].append(robot)
        self.senders: defaultdict[str, Counter[str]] = defaultdict(Counter)
        """By datum, how many robots of each vendor sent it."""
        for vendor, own in self.by_vendor.items():
            for robot in own:
                if robot["floor"] not in (None, "", NIL_DATUM):
                    self.senders[robot["floor"]][vendor] += 1

    def site_datums(self) -> list[str]:
        """A datum that several vendors send is the site's; another one is a vendor's own map."""
        return [datum for datum, vendors in self.senders.items() if len(vendors) > 1] or _most_sent(self.senders)


NO_DATUM = (
    "",
    "# No robot was heard on a floor. Robots send the UUID of theirs as planarDatum.",
    "# [[datums]]",
    f'# id = "{NIL_DATUM}"',
    '# name = "Ground floor"',
    '# reference_points = [{ id = "mark-1", name = "Column A1", x = 0.0, y = 0.0 }]',
)


def proposed_site(heard: HeardRobots, answers: SiteAnswers) -> str:
    """A site file in TOML."""
    site_datums, senders = heard.site_datums(), heard.senders
    lines = [
        "# Proposed from what robots sent. Look through each part, then run `deconflict check`.",
        f"name = {toml_value(answers.name)}",
    ]
    if answers.clearance_m is not None:
        lines += ["", "[conflict]", f"clearance_m = {answers.clearance_m:g}"]
    if not site_datums:
        lines += NO_DATUM
    for datum in site_datums:
        lines += _datum_lines(datum, answers.floor_names.get(datum, "Ground floor"), senders[datum])
    for vendor, own in sorted(heard.by_vendor.items()):
        own_datums = [datum for datum, vendors in senders.items() if vendor in vendors and datum not in site_datums]
        lines += _vendor_lines(vendor, own, own_datums, site_datums, vendor in answers.people)
    for vendor in answers.expected:
        lines += _vendor_lines(vendor, [], [], site_datums, vendor in answers.people)
    return "\n".join(map(visible, lines)) + "\n"


def _most_sent(senders: Mapping[str, Counter[str]]) -> list[str]:
    return sorted(senders, key=lambda datum: -senders[datum].total())[:1]


def _datum_lines(datum: str, name: str, vendors: Counter[str]) -> Iterator[str]:
    heard = ", ".join(f"{count} of {vendor}" for vendor, count in sorted(vendors.items()))
    yield from (
        "",
        f"# Robots that sent it: {heard}.",
        "[[datums]]",
        f"id = {toml_value(datum)}",
        f"name = {toml_value(name)}",
    )
    yield "# To be measured: four marks or more, spread over the floor, in metres; vendors with own maps read the same."
    yield '# reference_points = [{ id = "mark-1", name = "Column A1", x = 0.0, y = 0.0 }]'


def _vendor_lines(
    vendor: str, robots: list[RobotDocument], own_datums: list[str], site_datums: list[str], are_people: bool
) -> Iterator[str]:
    unnamed = sum(not robot["identified"] for robot in robots)
    yield from ("", "[[vendors]]", f"name = {toml_value(vendor)}")
    if are_people:
        yield 'participant = "person"'
    singular, plural = NOUNS["person" if are_people else "robot"]
    heard = count_of(len(robots), f"{singular} was", f"{plural} were") if robots else f"No {plural} were"
    yield f"# {heard} heard{f', {unnamed} of them without an identity report' if unnamed else ''}."
    makers = sorted({maker for robot in robots if (maker := _identity(robot, "manufacturerName"))} - {vendor})
    if makers:
        yield f"manufacturers = {toml_value(makers)}"
    for model, sizes in sorted(_models(robots).items()):
        yield f"# Model {model}: {sizes}. If that is wrong: [vendors.models.{toml_value(model)}]"
    for datum in own_datums:
        yield from (
            "# It alone sends this datum: a map of its own, or another floor. Of its own map, measure where its robots",
            "# say they are on each mark, or let `deconflict site align` find it from an hour of driving.",
            "# [[vendors.maps]]",
            f"# datum = {toml_value(datum)}",
            f"# site_datum = {toml_value(site_datums[0])}",
            "# readings = { mark-1 = [0.0, 0.0] }",
        )


def _models(robots: Iterable[RobotDocument]) -> dict[str, str]:
    """By model, its envelope as text."""
    models = {}
    for robot in robots:
        model, size = _identity(robot, "robotModel"), robot.get("envelope")
        if model and size:
            models[model] = f"{size['length_m']:g} x {size['width_m']:g} m"
    return models


def _identity(robot: RobotDocument, key: str) -> str:
    return str((robot["identity"] or {}).get(key) or "")
