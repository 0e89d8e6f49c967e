import re
from pathlib import Path

from deconflict.settings.importers.heard_robots import HeardRobots, proposed_site
from deconflict.settings.importers.site_questions import asked
from deconflict.settings.site_file import site_from_toml
from ingest.settings import NIL_DATUM

NAME = "Hall \U0001f600 \x7f \x9b \u202e"
HALL = "7d2b1c8e-3f64-4a95-9c1d-5e8f20a6b301"


def heard(vendor: str) -> dict[str, object]:
    return {
        "vendor": vendor,
        "name": vendor,
        "floor": HALL,
        "identified": False,
        "identity": None,
        "envelope": {"length_m": 1.2, "width_m": 0.8},
    }


def test_the_answers_of_a_person_are_in_the_proposed_site() -> None:
    robots = HeardRobots([heard("Alder"), heard("Walkers")])
    answers = iter(["Hall 7", "wide", "-1", "0,5", "Lower hall", "Corvid, Basalt", "n", "Yes", "", "n"])

    questions = []

    def ask(question: str, default: str) -> str:
        questions.append(question)
        return next(answers) or default

    answered = asked(ask, robots.by_vendor, robots.site_datums())
    assert [question for question in questions if "is no number" in question] == [
        f"'{wrong}' is no number from 0 to 100. Robots nearer than this are in conflict, in metres"
        for wrong in ("wide", "-1")
    ]
    site = site_from_toml(proposed_site(robots, answered).encode(), Path("proposed.toml"))
    assert (site.name, site.conflict.clearance_m, site.datums[0].name) == ("Hall 7", 0.5, "Lower hall")
    assert {vendor.name: vendor.participant for vendor in site.vendors} == {
        "Alder": "robot",
        "Walkers": "person",
        "Corvid": "robot",
        "Basalt": "robot",
    }


def test_who_answers_nothing_gets_what_was_heard() -> None:
    robots = HeardRobots([heard("Alder")])
    answered = asked(lambda _, default: default, robots.by_vendor, robots.site_datums())
    site = site_from_toml(proposed_site(robots, answered).encode(), Path("proposed.toml"))
    assert (site.name, [vendor.name for vendor in site.vendors]) == ("My site", ["Alder"])


def test_without_robots_the_named_vendors_are_in_the_file_and_a_floor_to_fill_in() -> None:
    answers = iter([NAME, "", "Corvid, Basalt", "", ""])
    robots = HeardRobots([])
    answered = asked(lambda _, default: next(answers) or default, robots.by_vendor, robots.site_datums())
    text = proposed_site(robots, answered)
    site = site_from_toml(text.encode(), Path("proposed.toml"))
    assert (site.name, [vendor.name for vendor in site.vendors]) == (NAME, ["Corvid", "Basalt"])
    uncommented = re.sub(r"^# (\[\[|id|name)", r"\1", text, flags=re.MULTILINE).replace(NIL_DATUM, HALL)
    filled = site_from_toml(uncommented.encode(), Path("proposed.toml"))
    assert len(filled.datums) == 1
