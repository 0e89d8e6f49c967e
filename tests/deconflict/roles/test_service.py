"""The service end to end: real sockets in, the stored and streamed advisories and the metrics out."""

import asyncio
import json
import time
from contextlib import closing
from datetime import datetime
from math import pi
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve

from deconflict.advice.requests import hold_requests
from deconflict.operator.ledger.loss_ledger import LossLedger
from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict.operator.ledger.loss_routes import loss_keys
from deconflict.roles.service import run_in_one_process
from deconflict.settings.site import EngineSettings
from deconflict_client.advisory import AdvisoryState
from deconflict_client.situations import REVISION, AnyRevision, advisories_of
from ingest.recording.log_reader import LogReader, Tick
from ingest.settings import Vendor
from metrics.monitoring.exposition import combine, render
from tests.deconflict.roles.made_service import CROSSING, SITE, Course, Running, drive, running, wait_behind_another
from tests.helpers.patience import PATIENCE_S
from tests.helpers.replayed import replayed, replayed_losses
from tests.helpers.saying import HALL, identity, status


def stream_of(service: Running) -> str:
    """The address of everything that is published."""
    return f"ws://{service.face}/advisories/stream?after=0&kinds=situation,advisory"


async def test_crossing_robots_have_an_advisory_from_raised_to_cleared(tmp_path: Path) -> None:
    async with running(tmp_path) as service, connect(stream_of(service)) as stream:
        driving = asyncio.create_task(drive(service.robots_url, CROSSING, 14))
        revisions: list[AnyRevision] = []
        async with asyncio.timeout(PATIENCE_S):
            async for message in stream:
                revisions.append(REVISION.validate_json(message))
                if revisions[-1].kind == "conflict" and revisions[-1].state is AdvisoryState.CLEARED:
                    break
        driving.cancel()
        advisories = advisories_of(revisions)
        assert {advisory.id for advisory in advisories} == {advisories[0].id}
        assert advisories[0].state is AdvisoryState.RAISED
        assert advisories[0].vendors == ("Alder", "Alder")
        assert advisories[0].location
        assert advisories[0].location.datum == HALL
        first = revisions[0].seq
        assert [revision.seq for revision in revisions] == list(range(first, first + len(revisions)))
        listed = (await service.get("/advisories?state=cleared")).json()["advisories"]
        assert [row["id"] for row in listed] == [advisories[0].id]
        assert any(advisory.recommendation for advisory in advisories)
        text = (await service.get("/metrics")).text
        assert float(text.split("\ndeconflict_advice_solve_seconds_count ")[1].split()[0]) > 0


async def test_conflicts_are_published_even_if_advice_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hold_requests, "advise_conflicts", broken)
    async with running(tmp_path) as service:
        driving = asyncio.create_task(drive(service.robots_url, CROSSING, 14))
        await service.until("/advisories", lambda answer: "no advice could be worked out" in json.dumps(answer))
        await service.until("/advisories?state=cleared", lambda answer: len(answer["advisories"]) == 1)
        driving.cancel()
        text = (await service.get("/metrics")).text
    assert float(text.split("\ndeconflict_advice_failures_total ")[1].split()[0]) > 0


def broken(*_: object, **__: object) -> None:
    raise ZeroDivisionError


async def test_robots_health_and_metrics_are_served(tmp_path: Path) -> None:
    async with running(tmp_path) as service, connect(service.robots_url) as socket:
        await socket.send(identity("A-1", time.time()))
        await socket.send(status("A-1", time.time(), 1.0, 2.0, batteryPercentage=55.5))
        await socket.send("nonsense")
        await service.until("/healthz", lambda health: health["status"] == "ok")
        robots = await service.until("/robots", lambda answer: len(answer["robots"]) == 1)
        (only,) = robots["robots"]
        assert only["status"]["batteryPercentage"] == 55.5
        assert only["location"] == {"x": 1.0, "y": 2.0, "yaw_rad": 0.0}
        rejected = await service.until("/quarantine", lambda answer: len(answer["rejected"]) == 1)
        assert rejected["rejected"][0]["message"] == "nonsense"
        text = (await service.get("/metrics")).text
        assert 'deconflict_messages_total{result="accepted",vendor="Alder"} 2.0' in text
        assert 'deconflict_role_up{role="engine"} 1.0' in text


async def test_each_vendor_has_its_rate_deviations_errors_and_grade(tmp_path: Path) -> None:
    async with running(tmp_path) as service:
        driving = asyncio.create_task(drive(service.robots_url, {"A-1": CROSSING["A-1"]}, 20))
        row = await service.until(
            "/vendors", lambda answer: answer["vendors"] and answer["vendors"][0]["messages_per_s"] is not None
        )
        driving.cancel()
        (alder,) = row["vendors"]
        assert (alder["name"], alder["robots"], alder["rejected"], alder["grade"]) == ("Alder", 1, 0, None)
        assert 1.0 < alder["messages_per_s"] < 3.0
        assert alder["coverage"]
        assert [entry["horizon_s"] for entry in alder["forecast_error"]] == [1, 3, 5, 10]
        assert sum(alder["deviations_by_rule"].values()) == alder["deviations"]


async def test_every_measure_is_catalogued(tmp_path: Path) -> None:
    async with run_in_one_process(SITE, tmp_path, render) as (receiver, operator):
        url = f"ws://127.0.0.1:{receiver.receiver.port}"
        await drive(url, CROSSING, 4)
        documents = await operator.sources.measures()
        names = {name for document in documents for name in (*document["values"], *document["histograms"])}
        assert {"deconflict_sweep_duration_seconds", "deconflict_robots"} <= names
        assert not combine(documents).uncatalogued


async def test_an_open_advisory_survives_a_restart_with_its_id(tmp_path: Path) -> None:
    meeting: dict[str, Course] = {"A-1": lambda t: (-20.0 + t, 0.0, 0.0), "B-1": lambda t: (20.0 - t, 0.0, pi)}
    start_s = time.time() - 13.0
    async with running(tmp_path) as service:
        driving = asyncio.create_task(drive(service.robots_url, meeting, 60, start_s))
        first = await service.until("/advisories", lambda answer: len(answer["advisories"]) == 1)
        driving.cancel()
    async with running(tmp_path) as service:
        driving = asyncio.create_task(drive(service.robots_url, meeting, 60, start_s))
        again = await service.until(
            "/advisories",
            lambda answer: any(
                advisory["revision"] > first["advisories"][0]["revision"] for advisory in answer["advisories"]
            ),
        )
        driving.cancel()
        assert [advisory["id"] for advisory in again["advisories"]] == [first["advisories"][0]["id"]]


@pytest.mark.parametrize("step_s", [-7200.0, 7200.0])
async def test_a_step_of_the_host_clock_clears_no_advisory_and_hides_no_robot(tmp_path: Path, step_s: float) -> None:
    stepped_s = [0.0]
    async with running(tmp_path, wall=lambda: time.time() + stepped_s[0]) as service:
        driving = asyncio.create_task(drive(service.robots_url, CROSSING, 60))
        raised = await service.until("/advisories", lambda answer: answer["advisories"])
        stepped_s[0] = step_s
        cleared = await service.until("/advisories?state=cleared", lambda answer: answer["advisories"])
        driving.cancel()
        (before,), (after,) = raised["advisories"], cleared["advisories"]
        assert (after["id"], after["cleared_because"]) == (before["id"], "they have passed each other")
        assert -10 < seconds_between(before["raised_at"], after["cleared_at"]) < 15
        robots = (await service.get("/robots")).json()["robots"]
        assert {robot["presence"] for robot in robots} == {"present"}
        assert "deconflict_host_clock_off_seconds" in (await service.get("/metrics")).text


def seconds_between(earlier: str, later: str) -> float:
    return (datetime.fromisoformat(later) - datetime.fromisoformat(earlier)).total_seconds()


async def test_the_recording_replays_to_the_same_advisories_and_situations(tmp_path: Path) -> None:
    async with running(tmp_path) as service:
        driving = asyncio.create_task(drive(service.robots_url, CROSSING, 60))
        listed = await service.until("/advisories?state=cleared", lambda answer: len(answer["advisories"]) == 1)
        driving.cancel()
        live = (await service.get(f"/advisories/{listed['advisories'][0]['id']}")).json()["advisories"]
        (situation,) = (await service.get("/situations?state=all")).json()["situations"]
        life = (await service.get(f"/situations/{situation['id']}")).json()["situations"]
    again, unnumbered = replay(tmp_path / "log"), {"seq": 0}
    assert [each for each in again if each["kind"] == "conflict"] == [each | unnumbered for each in live]
    situations = [each for each in again if each["kind"] == "situation"]
    assert situations[: len(life)] == [each | unnumbered for each in life]


async def test_the_recording_replays_to_the_same_ledger_of_lost_time(tmp_path: Path) -> None:
    group = "/losses?group=hour,vendor,model,by,root,kind,floor,place,cell"
    async with running(tmp_path) as service:
        driving = asyncio.create_task(wait_behind_another(service.robots_url))
        live = await service.until(group, lambda answer: answer["rows"])
        driving.cancel()
    losses = replayed_losses(tmp_path / "log", SITE)
    assert replayed_losses(tmp_path / "log", SITE) == losses
    with closing(LossLedger(None, SITE.losses)) as ledger:
        ledger.add("replay", 1, losses)
        keys = loss_keys(group.split("=")[1])
        again = ledger.ask(LossQuestion(live["from_s"], live["until_s"], keys)).model_dump(mode="json")
    assert again["rows"] == live["rows"]
    assert again["total"]["lost_s"] > 1.0


async def test_an_overloaded_service_shows_it_still_warns_and_replays_to_the_same_advisories(tmp_path: Path) -> None:
    hurried = SITE.model_copy(update={"engine": EngineSettings(deadline_s=1e-9)})
    async with running(tmp_path, hurried) as service:
        driving = asyncio.create_task(drive(service.robots_url, CROSSING, 60))
        listed = await service.until("/advisories?state=cleared", lambda answer: len(answer["advisories"]) == 1)
        driving.cancel()
        live = (await service.get(f"/advisories/{listed['advisories'][0]['id']}")).json()["advisories"]
        health = await service.until("/healthz", lambda health: health["effort"] == "near")
        assert health["status"] == "ok"
        text = (await service.get("/metrics")).text
        assert "deconflict_engine_effort_reduced 2.0" in text
        assert float(text.split("\ndeconflict_deadlines_missed_total ")[1].split()[0]) > 10
    efforts = [event.effort for event in LogReader().read([tmp_path / "log"]) if isinstance(event, Tick)]
    assert (efforts[0], sorted(set(efforts)), efforts[-1]) == (0, [0, 1, 2], 2)
    assert live[0]["time_to_conflict_s"] <= SITE.conflict.warning_s
    assert replay(tmp_path / "log")[0] == live[0] | {"seq": 0}


def replay(log: Path) -> list[dict[str, Any]]:
    return [json.loads(advisory.model_dump_json()) for advisory in replayed(log, SITE)]


async def test_the_floor_is_as_it_was_after_a_restart(tmp_path: Path) -> None:
    async with running(tmp_path) as service:
        async with connect(service.robots_url) as socket:
            await socket.send(identity("A-1", time.time()))
            await socket.send(status("A-1", time.time(), 1.0, 2.0))
        await service.until("/robots", lambda answer: len(answer["robots"]) == 1 and answer["robots"][0]["status"])
    async with running(tmp_path) as service:
        (only,) = (await service.until("/robots", lambda answer: answer["robots"]))["robots"]
        assert only["identified"]
        assert only["location"] == {"x": 1.0, "y": 2.0, "yaw_rad": 0.0}
        text = (await service.get("/metrics")).text
        assert 'deconflict_messages_total{result="accepted",vendor="Alder"}' not in text


async def test_the_service_dials_a_fleet_manager_and_receives_its_robots(tmp_path: Path) -> None:
    async def speak(socket: ServerConnection) -> None:
        await socket.send(status("B-1", time.time(), 3.0))
        await socket.wait_closed()

    async with serve(speak, "127.0.0.1", 0) as manager:
        port = next(iter(manager.sockets)).getsockname()[1]
        basalt = Vendor(name="Basalt", dial=(f"ws://127.0.0.1:{port}",))
        async with running(tmp_path, SITE.model_copy(update={"vendors": (basalt,)})) as service:
            (only,) = (await service.until("/robots", lambda answer: answer["robots"]))["robots"]
            assert (only["vendor"], only["identified"]) == ("Basalt", False)
