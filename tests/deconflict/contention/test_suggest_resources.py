"""Resources proposed from a log of robots that keep standing somewhere."""

import json
import tomllib
from pathlib import Path

import pytest

from deconflict.contention.suggest_resources import suggested
from deconflict.settings.site import Site
from deconflict.settings.site_file import load
from tests.deconflict.contention.scenes import NOW_S, Script, resource, site
from tests.helpers.saying import HALL, identity, stamp


def log(folder: Path) -> Path:
    """Three vendors stop at (10, 0) one after the other, twice each; one parks alone; a fourth only drives by."""
    comes = [(0, 0, -8), (10, 10, 0), (40, 10, 0), (50, 20, -8), (60, 20, -8)]
    robots = {
        vendor: Script(
            [(at + 70 * turn, x, y + 20 * row * (x != 10)) for turn in (row, row + 4) for at, x, y in comes],
            vendor=vendor,
            state=lambda _: "waitingExternalEvent",
        )
        for row, vendor in enumerate(("Alder", "Basalt", "Corvid"))
    }
    robots["Solo"] = Script([(0, 40, 40)], state=lambda _: "idle")
    robots["Passer"] = Script([(0, -50, 0), (600, 550, 0)])
    path = folder / "log.jsonl"
    with path.open("w") as out:
        for t in range(560):
            for name, script in robots.items():
                messages = [identity(name, NOW_S + t, manufacturerName=script.vendor)] if t == 0 else []
                for message in (*messages, script.says(name, t)):
                    out.write(json.dumps({"received": stamp(NOW_S + t), "message": json.loads(message)}) + "\n")
    return path


def test_a_place_where_several_vendors_stop_is_proposed_and_loads(tmp_path: Path) -> None:
    text = suggested([log(tmp_path)], site())
    assert "6 stops of Alder, Basalt, Corvid, 30 s in the middle" in text
    assert len([load for load in tomllib.loads(text)["resources"] if 9 < load["polygon"][0][0] < 10]) == 1
    pasted = tmp_path / "site.toml"
    pasted.write_text(f'[[datums]]\nid = "{HALL}"\nname = "Hall"\n\n{text}')
    (found,) = [
        resource for resource in load(pasted).resources if resource.polygon[0][0] == pytest.approx(9.5, abs=0.11)
    ]
    assert (found.kind, found.datum, found.capacity) == ("dock", HALL, 1)


@pytest.mark.parametrize("known", [site(resource("d1", 10, 0)), site(resource("d1", 10, 0), resource("d2", 60, 60))])
def test_resources_of_the_site_file_are_not_proposed_again(known: Site, tmp_path: Path) -> None:
    answer = tomllib.loads(suggested([log(tmp_path)], known)).get("resources", [])
    assert not [row for row in answer if 9 < row["polygon"][0][0] < 10]
