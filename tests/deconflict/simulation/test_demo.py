import json
import signal
import subprocess
import sys
from contextlib import closing
from io import StringIO
from math import inf
from pathlib import Path

import pytest
import shapely
from rich.console import Console

from deconflict.operator.ledger.loss_ledger import LossLedger
from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict.settings.shared_places import Resource, outlines
from deconflict.settings.site import LossSettings
from deconflict.settings.site_file import fit_problems, load
from deconflict.simulation.demo.demo_floor import with_halls
from deconflict.simulation.demo.demo_site import ROBOTS, demo_site
from deconflict.simulation.demo.demo_view import DemoView, advisory_line, tables
from deconflict.simulation.floor_layout import Bay, layout_for
from tests.deconflict.roles.made_service import free_ports
from tests.helpers.made_advisories import cleared, made
from tests.helpers.patience import PATIENCE_S


def test_the_bundled_site_is_sound() -> None:
    site = load(demo_site())
    assert fit_problems(site) == []
    assert [datum.level for datum in site.datums] == [0, 1]
    assert len(site.vendors) == 4


def test_further_halls_are_drawn_and_have_places_of_their_own() -> None:
    site = with_halls(load(demo_site()), 200)
    assert fit_problems(site) == []
    assert with_halls(load(demo_site()), 80) == load(demo_site())
    drawn = shapely.MultiPolygon([shapely.Polygon(part.outline_m) for part in site.obstacles if not part.name])
    assert drawn.bounds == (-0.3, -20.3, 3 * 99.0 + 0.3, 54.3), "walls around all halls"
    names = {place.id: place.label for place in site.resources}
    assert names["charger-1-hall-3"] == "Charger 1 of hall 3"
    assert "annex-charger-hall-2" not in names, "there is one annex"
    for bay in layout_for(200).bays:
        found = [place.kind for place in site.resources if _holds(place, site.datums[bay.floor].id, bay)]
        assert found == ([bay.kind] if bay.kind in ("charger", "lift") else [])


def _holds(place: Resource, floor: str, bay: Bay) -> bool:
    point = shapely.Point(bay.place)
    return any(datum == floor and shapely.Polygon(outline).contains(point) for datum, outline in outlines(place))


def test_a_demo_that_is_interrupted_while_it_starts_ends_quietly(tmp_path: Path) -> None:
    robots, operator = free_ports(2)
    command = [sys.executable, "-m", "deconflict", "demo", "--data", str(tmp_path)]
    ports = ["--robots-port", str(robots), "--operator-port", str(operator)]
    with subprocess.Popen([*command, *ports], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout
        while "Starting the service" not in process.stdout.readline():
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, "Traceback" in errors) == (0, False), errors
    assert json.loads(output.splitlines()[-1])["messages"] == 0


def test_the_demo_ends_by_itself_and_tells_what_happened(tmp_path: Path) -> None:
    robots, operator = free_ports(2)
    command = [sys.executable, "-m", "deconflict", "demo", "--seconds", "20", "--data", str(tmp_path)]
    ports = ["--robots-port", str(robots), "--operator-port", str(operator)]
    done = subprocess.run([*command, *ports], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    document = json.loads(done.stdout.splitlines()[-1])
    assert (document["robots"], document["rejected"]) == (ROBOTS, 0)
    assert document["messages"] > 300
    assert document["advisories_raised"] >= document["conflicts"] > 0
    assert document["deadlocks"] > 0
    assert document["queues"] > 0
    assert document["advisories_cleared"] > 0
    assert document["latency_p99_ms"] > 0
    with closing(LossLedger(tmp_path, LossSettings())) as ledger:
        kept = ledger.ask(LossQuestion(0.0, inf, ("vendor", "by")))
    assert document["lost_to_others_s"] == kept.total.lost_s
    assert sum(row.lost_s for row in kept.rows) == pytest.approx(kept.total.lost_s, abs=1.0)
    assert f"http://127.0.0.1:{operator}/advisories" in done.stdout
    assert f"Robots: {ROBOTS}, messages: {document['messages']:,}, of these rejected: 0." in done.stdout
    assert list((tmp_path / "log").glob("*.jsonl"))


@pytest.mark.parametrize("name", ["[/bold]", "[red]", "x\x1b[2J\n\x9b\u202e", "[link=file:///etc/passwd]"])
def test_the_demo_shows_any_name_as_it_is(name: str) -> None:
    view = DemoView()
    view.add_advisory(made(1, summary=f"{name} meets B-1", vendors=(name, "Basalt")))
    view.values["deconflict_robots"] = {(name, "idle"): 1}
    console = Console(file=StringIO(), width=200)
    console.print(tables(view, ""))
    for advisory in (made(1, summary=name), cleared(1, names=(name, "Basalt B-1"))):
        console.print(advisory_line(advisory), soft_wrap=True)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert all(line.isprintable() for line in text.splitlines())
    assert text.count(name.encode("unicode_escape").decode()) == 5
