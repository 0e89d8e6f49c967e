"""A site file that is proposed from what robots sent is one that loads."""

import tomllib
from pathlib import Path
from typing import Any

from deconflict.settings.importers.heard_robots import HeardRobots, proposed_site
from deconflict.settings.importers.site_questions import SiteAnswers
from deconflict.settings.site_file import site_from_toml

HALL, OWN = "7d2b1c8e-3f64-4a95-9c1d-5e8f20a6b301", "9e6b7a52-0f6d-4d0a-8f0e-7b1c2d3e4f50"


def heard(vendor: str, name: str, floor: str | None, **identity: str) -> dict[str, Any]:
    envelope = {"length_m": 1.2, "width_m": 0.8}
    return {
        "vendor": vendor,
        "name": name,
        "floor": floor,
        "identified": bool(identity),
        "identity": identity or None,
        "envelope": envelope,
    }


def test_the_datum_of_several_vendors_is_the_sites_and_another_one_is_a_vendors_own_map() -> None:
    robots = [
        heard("Alder", "A-1", HALL, manufacturerName="Alder Robotics", robotModel="A100"),
        heard("Corvid", "C-1", HALL, manufacturerName="Corvid", robotModel="C20"),
        heard("Basalt", "B-1", OWN, manufacturerName="Basalt", robotModel="B7"),
        heard("Basalt", "B-2", None),
    ]
    text = proposed_site(HeardRobots(robots), SiteAnswers())
    site = site_from_toml(text.encode(), Path("proposed.toml"))
    assert [datum.id for datum in site.datums] == [HALL]
    assert [(vendor.name, vendor.manufacturers) for vendor in site.vendors] == [
        ("Alder", ("Alder Robotics",)),
        ("Basalt", ()),
        ("Corvid", ()),
    ]
    assert "# Model A100: 1.2 x 0.8 m." in text
    assert "# 2 robots were heard, 1 of them without an identity report." in text
    assert f'# datum = "{OWN}"' in text
    uncommented = text.replace("# [[vendors.maps]]", "[[vendors.maps]]").replace("# datum", "datum")
    uncommented = uncommented.replace("# site_datum", "site_datum").replace("# readings", "readings")
    assert tomllib.loads(uncommented)["vendors"][1]["maps"][0]["site_datum"] == HALL


def test_one_vendor_alone_gives_its_most_used_datum() -> None:
    text = proposed_site(HeardRobots([heard("Alder", "A-1", OWN)]), SiteAnswers())
    site = site_from_toml(text.encode(), Path("proposed.toml"))
    assert [datum.id for datum in site.datums] == [OWN]


def test_no_name_adds_a_key_to_the_proposed_site_file() -> None:
    hostile = 'Alder"\n[operator]\nhost = "0.0.0.0"\r\x1b[2J\u2028'
    robot = heard(hostile, "A-1", hostile, manufacturerName=f"{hostile} GmbH", robotModel=hostile)
    text = proposed_site(HeardRobots([robot]), SiteAnswers())
    assert all(line.isprintable() for line in text.split("\n"))
    proposed = tomllib.loads(text)
    assert proposed.keys() == {"name", "datums", "vendors"}
    assert proposed["vendors"] == [{"name": hostile, "manufacturers": [f"{hostile} GmbH"]}]
