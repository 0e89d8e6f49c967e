from pathlib import Path

from deconflict.roles.health.recording_health import DROPPED, DROPPED_SHOWN_S, FAILING, PACKING_FAILING, RecordingHealth
from ingest.measures.measures import Measures
from ingest.recording.log_packing import UNFINISHED
from tests.deconflict.roles.made_service import healthy, running


def receiver(failing: float, dropped: int) -> list[dict[str, object]]:
    measures = Measures()
    measures.level(FAILING, {(): failing})
    measures.count(DROPPED, by=dropped)
    return [measures.as_document()]


def test_lines_that_are_dropped_show_for_a_minute() -> None:
    health = RecordingHealth()
    health.note_measures(receiver(0, 698), 100.0)
    assert health.document(100.0) == {"status": "ok", "lines_dropped": 698}
    health.note_measures(receiver(0, 700), 110.0)
    shown = health.document(110.0)
    assert (shown["status"], shown["lines_dropped"]) == ("degraded", 700)
    health.note_measures(receiver(0, 700), 120.0)
    assert health.document(110.0 + DROPPED_SHOWN_S)["status"] == "ok"
    health.note_measures(receiver(1, 700), 200.0)
    assert "nothing is recorded" in health.document(200.0)["reason"]


def test_segments_that_are_not_packed_show_until_they_are() -> None:
    health = RecordingHealth()
    for failing in (1.0, 0.0):
        measures = Measures()
        measures.level(PACKING_FAILING, {(): failing})
        health.note_measures([measures.as_document()], 100.0)
        assert ("not packed" in health.document(100.0).get("reason", "")) is bool(failing)


async def test_health_shows_that_older_segments_can_not_be_packed(tmp_path: Path) -> None:
    (tmp_path / "log" / UNFINISHED).mkdir(parents=True)
    for number in (1, 2):
        (tmp_path / "log" / f"log-{number}.jsonl").touch()
    async with running(tmp_path) as service:
        health = (await service.get("/healthz")).json()
        while health["recording"]["status"] == "ok":
            health = (await service.get("/healthz")).json()
        assert "not packed" in health["recording"]["reason"]
        await service.metrics_with("deconflict_recording_packing_failing 1")


async def test_health_shows_that_nothing_is_recorded(tmp_path: Path) -> None:
    (tmp_path / "log").write_text("a file where the directory of the log belongs")
    async with running(tmp_path) as service:
        health = (await service.get("/healthz")).json()
        while health["recording"]["status"] == "ok":
            health = (await service.get("/healthz")).json()
        assert not healthy(health)
        assert "nothing is recorded" in health["recording"]["reason"]
