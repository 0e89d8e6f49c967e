"""A changed site file is taken up while robots and subscribers stay connected, or refused as a whole."""

import asyncio
import json
import os
import re
import signal
import time
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.protocol import State

from deconflict.roles.role_files import PreparationProgress
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.hot_reload import (
    NEEDS_RESTART,
    RESULTS_FILE,
    SITE_FILE,
    CurrentSite,
    Reloader,
    merged_settings,
)
from deconflict.settings.site import Conflict, Operator, Site
from deconflict.settings.site_file import MOST_PROBLEMS, SiteError, load
from ingest.settings import ReceiverSettings, Vendor
from tests.deconflict.operator.outlets.made_outlets import SECRET, hearing
from tests.deconflict.roles.made_disks import disk_of, fill
from tests.deconflict.roles.made_service import Served, healthy
from tests.helpers.made_site import toml
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client
from tests.helpers.saying import HALL, identity, robot, status

DOCS = Path(__file__).parents[3] / "docs" / "operation.md"
MARKS = {"a": (0.0, 0.0), "b": (10.0, 0.0), "c": (0.0, 10.0), "d": (10.0, 10.0)}


def told(*vendors: str, shift_m: float = 0.0, **sections: Any) -> dict[str, Any]:
    """A site file; the first vendor's own map is shifted along x."""
    hall = {"id": HALL, "name": "Hall", "reference_points": [{"id": i, "x": x, "y": y} for i, (x, y) in MARKS.items()]}
    readings = {mark: [x - shift_m, y] for mark, (x, y) in MARKS.items()}
    own = {"datum": HALL, "site_datum": HALL, "readings": readings}
    everyone: list[dict[str, Any]] = [{"name": name} for name in vendors]
    everyone[0]["maps"] = [own]
    return {"datums": [hall], "vendors": everyone} | sections


def dock(place: str) -> dict[str, Any]:
    return {"id": place, "kind": "dock", "datum": HALL, "polygon": [[20, 20], [22, 20], [22, 22]]}


def test_most_settings_change_at_once_and_some_need_a_restart() -> None:
    before = Site(receiver=ReceiverSettings(port=1), operator=Operator(port=2))
    wanted = Site(
        receiver=ReceiverSettings(port=5),
        operator=Operator(port=6, stream_send_timeout_s=3.0),
        conflict=Conflict(clearance_m=0.7),
        vendors=(Vendor(name="Alder"),),
    )
    site, waiting = merged_settings(before, wanted)
    assert (site.receiver, site.operator) == (before.receiver, wanted.operator.model_copy(update={"port": 2}))
    assert (site.conflict, site.vendors) == (wanted.conflict, wanted.vendors)
    assert waiting == ("receiver.port", "operator.port")


def test_the_docs_state_for_every_section_when_it_takes_effect() -> None:
    (row,) = re.findall(r"^\| (`name`.+?) \| (.+?) \|$", DOCS.read_text(encoding="utf-8"), re.M)
    at_once, later = ({name.split(".")[0] for name in re.findall(r"`([\w.]+)`", cell)} for cell in row)
    assert later == NEEDS_RESTART.keys()
    assert (at_once - {"maps", "models", "credentials", "dial"}) | later == Site.model_fields.keys()
    assert at_once & later == {section for section, keys in NEEDS_RESTART.items() if keys}


def test_a_change_that_contradicts_one_that_needs_a_restart_is_refused() -> None:
    secured = Site.model_validate(
        {"receiver": {"tls": {"certificate": "a.pem", "clients": "b.pem"}}, "vendors": [{"name": "Alder"}]}
    )
    named = secured.model_copy(update={"vendors": (Vendor(name="Alder", certificate_names=("alder",)),)})
    with pytest.raises(SiteError, match=r"receiver\.tls\.clients: is missing(?s:.*)restart the service to change"):
        merged_settings(Site(), named)
    assert merged_settings(secured, named) == (named, ())


def test_the_cluster_section_needs_a_restart() -> None:
    cluster = Cluster(nats=("nats://127.0.0.1:4222",))
    site, waiting = merged_settings(Site(cluster=cluster), Site(conflict=Conflict(clearance_m=0.7)))
    assert (site.cluster, site.conflict.clearance_m, waiting) == (cluster, 0.7, ("cluster",))


def test_an_unusable_file_changes_nothing(tmp_path: Path) -> None:
    answers: list[Site | SiteError] = [SiteError(["conflict: is wrong"]), Site(name="new")]

    def read() -> Site:
        answer = answers.pop(0)
        if isinstance(answer, SiteError):
            raise answer
        return answer

    reloader, role = Reloader(Site(name="old"), read, tmp_path), CurrentSite(tmp_path, Site(name="old"))
    reloader.reload_if_requested()
    assert (role.changed(), len(answers)) == (None, 2)
    reloader.request()
    reloader.reload_if_requested()
    outcome = json.loads((tmp_path / RESULTS_FILE).read_text())
    assert (outcome["refused"], outcome["problems"], role.changed()) == (1, ["conflict: is wrong"], None)
    reloader.request()
    reloader.reload_if_requested()
    changed = role.changed()
    assert changed
    assert (changed.name, role.changed()) == ("new", None)
    assert json.loads((tmp_path / SITE_FILE).read_text())["name"] == "new"


@pytest.mark.parametrize(
    "text",
    [
        "name = " + 3000 * "[" + 3000 * "]",
        ".".join(2000 * "a") + " = 1",
        "[conflict]\nclearance_m = " + 5000 * "9",
        "[conflict]\nclearance_m = 0x" + 5000 * "f",
    ],
    ids=["deep", "long key", "long number", "long hexadecimal number"],
)
def test_a_file_that_no_parser_can_read_is_refused_and_ends_nothing(tmp_path: Path, text: str) -> None:
    path = tmp_path / "site.toml"
    path.write_text(text)
    reloader = Reloader(Site(name="old"), lambda: load(path), tmp_path)
    reloader.request()
    reloader.reload_if_requested()
    outcome = json.loads((tmp_path / RESULTS_FILE).read_text())
    assert (outcome["refused"], outcome["applied"]) == (1, 0)
    assert "see the log" not in outcome["problems"][0]


def test_of_many_problems_of_a_file_the_first_are_written_out(tmp_path: Path) -> None:
    path = tmp_path / "site.toml"
    path.write_text("".join(f'[[zones]]\nid = "z{number}"\nkind = "crossing"\n' for number in range(3000)))
    with pytest.raises(SiteError) as refused:
        load(path)
    assert len(refused.value.problems) == MOST_PROBLEMS + 1
    assert refused.value.problems[-1] == "and 5,900 more problems"


def test_a_fault_in_checking_a_file_ends_nothing(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    reloader = Reloader(Site(name="old"), lambda: Site(name=str(1 // 0)), tmp_path)
    reloader.request()
    reloader.reload_if_requested()
    outcome = json.loads((tmp_path / RESULTS_FILE).read_text())
    assert outcome["problems"] == ["it can't be checked: ZeroDivisionError; see the log"]
    assert "ZeroDivisionError" in caplog.text


def test_the_log_names_the_changed_keys_that_need_a_restart(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    values = {"recorder": {"enabled": False, "keep_days": 2.0}, "operator": {"port": 81, "stream_send_timeout_s": 2.0}}
    reloader, role = Reloader(Site(), lambda: Site.model_validate(values), tmp_path), CurrentSite(tmp_path, Site())
    reloader.request()
    reloader.reload_if_requested()
    assert [record.getMessage() for record in caplog.records if record.levelname == "WARNING"] == [
        "these keys of the site file need a restart: recorder.enabled, operator.port"
    ]
    changed = role.changed()
    assert changed
    assert (changed.recorder.enabled, changed.recorder.keep_days) == (True, 2.0)
    assert changed.operator.stream_send_timeout_s == 2.0


async def placed(service: Served, x: float) -> None:
    def there(answer: dict[str, Any]) -> bool:
        robots = {row["uuid"]: row["location"] for row in answer.get("robots", [])}
        return bool(robots.get(robot("A-1")) and abs(robots[robot("A-1")]["x"] - x) < 1e-6)

    await service.until("/robots", there)


async def reloaded(service: Served) -> tuple[int, dict[str, Any]]:
    async with http_client() as client:
        answer = await client.post(f"{service.face_url}/site/reload")
        return answer.status_code, answer.json()


async def reloads(service: Served) -> dict[str, float]:
    """By result, as Prometheus reads it."""
    async with http_client() as client:
        text = (await client.get(f"{service.face_url}/metrics")).text
    rows = [line for line in text.splitlines() if line.startswith("deconflict_site_reloads_total{")]
    return {row.split('"')[1]: float(row.split()[-1]) for row in rows}


async def test_a_changed_file_takes_effect_without_closing_a_connection(tmp_path: Path) -> None:
    file = tmp_path / "site.toml"
    file.write_text(toml(told("Alder", "Corvid")))
    service = Served(tmp_path / "data", file)
    with service.running() as pid:
        await service.until("/healthz", healthy)
        alder, corvid = await connect(f"{service.robots_url}/Alder"), await connect(f"{service.robots_url}/Corvid")
        stream = await connect(f"ws://127.0.0.1:{service.operator_port}/advisories/stream")
        await alder.send(identity("A-1", time.time()))
        await alder.send(status("A-1", time.time(), 1.0))
        await placed(service, 1.0)

        file.write_text(toml(told("Alder", "Basalt", shift_m=5.0, resources=[dock("d1")], recorder={"enabled": False})))
        os.kill(pid, signal.SIGHUP)
        await service.until("/site", lambda site: [place["id"] for place in site["places"]] == ["d1"])
        await placed(service, 6.0)
        health = await service.until("/healthz", lambda health: health["site"].get("needs_restart"))
        assert health["site"]["needs_restart"] == ["recorder.enabled"]
        await ended(corvid, "Corvid was taken out of the site file")
        await alder.send(status("A-1", time.time(), 2.0))
        await placed(service, 7.0)
        async with connect(f"{service.robots_url}/Basalt") as basalt:
            await basalt.send(status("B-1", time.time(), 3.0))
            await service.until("/robots?vendor=Basalt", lambda answer: len(answer["robots"]) == 1)

        file.write_text(toml(told("Alder", "Alder", conflict={"clearance": 1.0})))
        code, answer = await reloaded(service)
        assert (code, answer["applied"]) == (422, False)
        assert any("did you mean clearance_m?" in problem for problem in answer["problems"])
        await placed(service, 7.0)
        assert await reloads(service) == {"applied": 1, "refused": 1}

        file.write_text(toml(told("Alder", shift_m=6.0)))
        assert await reloaded(service) == (200, {"applied": True, "problems": [], "needs_restart": []})
        await placed(service, 8.0)
        assert (alder.state, stream.state) == (State.OPEN, State.OPEN)
        for socket in (alder, stream):
            await socket.close()


async def test_limits_and_outlets_take_effect_without_closing_a_connection(tmp_path: Path) -> None:
    file, secret = tmp_path / "site.toml", tmp_path / "secret"
    secret.write_text(SECRET)
    file.write_text(toml(told("Alder", "Basalt")))
    service = Served(tmp_path / "data", file)
    with hearing() as other, service.running() as pid:
        await service.until("/healthz", healthy)
        async with connect(f"{service.robots_url}/Alder") as alder, service.with_robots(time.time() - 21.0):
            await service.until("/advisories", lambda answer: answer["advisories"])
            await alder.send(identity("A-9", time.time()))
            for _ in range(30):
                await alder.send(status("A-9", time.time(), 40.0))
            assert await shed(service, "Alder") == 0
            hook = {"name": "mes", "url": other.url, "secret": f"file:{secret}"}
            limits = {"max_messages_per_s": 3.0, "max_connections": 500}
            file.write_text(
                toml(told("Alder", "Basalt", receiver=limits, webhooks=[hook], recorder={"keep_days": 2.0}))
            )
            os.kill(pid, signal.SIGHUP)
            async with asyncio.timeout(PATIENCE_S):
                while not other.heard or not await shed(service, "Alder"):
                    for _ in range(10):
                        await alder.send(status("A-9", time.time(), 40.0))
                    await asyncio.sleep(0.1)
            health = await service.until("/healthz", healthy)
            assert health["site"] == {"problems": [], "needs_restart": []}
            assert alder.state is State.OPEN


async def shed(service: Served, vendor: str) -> float:
    """Messages of a vendor that were shed, as Prometheus reads it."""
    async with http_client() as client:
        text = (await client.get(f"{service.face_url}/metrics")).text
    rows = [line for line in text.splitlines() if line.startswith("deconflict_messages_shed_total{") and vendor in line]
    return sum(float(row.split()[-1]) for row in rows)


async def ended(socket: ClientConnection, reason: str) -> None:
    with pytest.raises(ConnectionClosed, match=reason):
        async with asyncio.timeout(PATIENCE_S):
            await socket.recv()


async def test_an_open_advisory_continues_under_other_settings(tmp_path: Path) -> None:
    file = tmp_path / "site.toml"
    file.write_text(toml({"conflict": {"clearance_m": 0.3}}))
    service = Served(tmp_path / "data", file)
    with service.running() as pid:
        await service.until("/healthz", healthy)
        async with service.with_robots(time.time() - 21.0):
            before = await service.until("/advisories", lambda answer: len(answer["advisories"]) == 1)
            file.write_text(toml({"conflict": {"clearance_m": 0.6}}))
            os.kill(pid, signal.SIGHUP)
            after = await service.until(
                "/advisories?state=all", lambda answer: answer["advisories"][0]["clearance_m"] == 0.6
            )
        assert [advisory["id"] for advisory in after["advisories"]] == [before["advisories"][0]["id"]]


def test_a_full_runtime_directory_ends_neither_a_reload_nor_the_preparation_of_an_engine(tmp_path: Path) -> None:
    """It is in memory, of which containers have little. The old settings hold until there is room."""
    with disk_of(tmp_path, "256k") as runtime:
        reloader, current = Reloader(Site(), lambda: Site(name="other"), runtime), CurrentSite(runtime, Site())
        ballast = fill(runtime)
        reloader.request()
        reloader.reload_if_requested()
        PreparationProgress(runtime).report(0, 3)
        assert current.changed() is None
        ballast.unlink()
        reloader.request()
        reloader.reload_if_requested()
        assert (changed := current.changed())
        assert changed.name == "other"
        results = json.loads((runtime / RESULTS_FILE).read_text())
        assert (results["applied"], results["refused"], results["problems"]) == (1, 1, [])
