from pathlib import Path

from deconflict.roles.health.recording_health import PACKING_FAILING, RecordingHealth
from ingest.measures.measures import Measures
from ingest.recording.log_packing import UNFINISHED
from tests.deconflict.roles.made_service import healthy, running


def test_segments_that_are_not_packed_show_until_they_are() -> None:
    health = RecordingHealth()
    for failing in (1.0, 0.0):
        measures = Measures()
        measures.level(PACKING_FAILING, {(): failing})
        health.note_measures([measures.as_document()])
        assert ("not packed" in health.document().get("reason", "")) is bool(failing)


async def test_health_shows_that_older_segments_can_not_be_packed(tmp_path: Path) -> None:
    (tmp_path / "log" / UNFINISHED).mkdir(parents=True)
    for number in (1, 2):
        (tmp_path / "log" / f"log-{number}.jsonl").touch()
    async with running(tmp_path) as service:
        await service.health(lambda health: "not packed" in health["recording"].get("reason", ""))
        await service.metrics_with("deconflict_recording_packing_failing 1")


async def test_health_shows_that_nothing_is_recorded(tmp_path: Path) -> None:
    (tmp_path / "log").write_text("a file where the directory of the log belongs")
    async with running(tmp_path) as service:
        health = await service.health(lambda health: "nothing is recorded" in health["recording"].get("reason", ""))
        assert not healthy(health)
