"""What a replay tells of each vendor's trust: what the live service would have, at its measures' own words."""

from datetime import datetime
from pathlib import Path
from typing import Any

from deconflict.operator.vendor_health import vendor_health
from ingest.languages import timestamps
from ingest.measures import clock_changes
from ingest.measures.change_detection import LevelChange
from ingest.measures.measures import Measures
from metrics.scoring.vendor_records import MOST_FLAGS, VendorRecords
from tests.helpers.saying import identity, status
from tests.metrics.replay.made_replays import NOW_S, scored

SLOW_S = 4.0


def seconds(stamp: str) -> float:
    return datetime.fromisoformat(stamp).timestamp()


def measured(
    by_s: float | None = None, *, since_s: float = NOW_S, distrusted: int = 0, forecasts: int = 0
) -> list[dict[str, Any]]:
    """What receiver and engine tell of a vendor whose clocks have changed by so much, if they have."""
    receiver, engine = Measures(), Measures()
    receiver.count("deconflict_messages_total", "Alder", "accepted", by=90)
    clock_changes.publish(receiver, {"clock": {"Alder": LevelChange(since_s, by_s)} if by_s else {}})
    engine.level("deconflict_robots_distrusted", {("Alder",): distrusted})
    engine.count("deconflict_forecasts_distrusted_total", "Alder", by=forecasts)
    engine.level("deconflict_forecast_grade", {("Alder", "B"): 1.0})
    engine.level("deconflict_forecast_band_coverage_ratio", {("Alder", "0.9"): 0.91})
    return [receiver.as_document(), engine.as_document()]


def test_an_ended_flag_is_kept_with_its_end_and_its_largest_size() -> None:
    records = VendorRecords()
    for minute, by_s in enumerate((None, 2.0, 3.0, 1.0, None, None)):
        records.update(NOW_S + 60 * minute, measured(by_s))
    (alder,) = records.figures({"Alder": 0.02})
    (flag,) = alder["flags"]
    (live,) = vendor_health(measured(3.0))[0].flags
    assert {name: flag[name] for name in ("what", "since", "by", "words")} == live.model_dump(mode="json")
    assert seconds(flag["until"]) == NOW_S + 240
    assert (alder["grade"], alder["coverage"], alder["ece"]) == ("B", [{"share": 0.9, "covered": 0.91}], 0.02)


def test_a_flag_that_stands_at_the_end_has_no_end() -> None:
    records = VendorRecords()
    records.update(NOW_S, measured(2.0))
    assert [figure["until"] for figure in records.figures({})[0]["flags"]] == [None]


def test_the_largest_number_of_distrusted_robots_is_kept() -> None:
    records = VendorRecords()
    for robots, forecasts in ((1, 4), (3, 9), (0, 9)):
        records.update(NOW_S, measured(distrusted=robots, forecasts=forecasts))
    (alder,) = records.figures({})
    assert (alder["distrusted"], alder["forecasts_distrusted"], alder["ece"]) == (3, 9, None)


def test_of_many_flags_the_newest_are_kept() -> None:
    records = VendorRecords()
    for n in range(MOST_FLAGS + 20):
        records.update(NOW_S + 60 * n, measured(2.0, since_s=NOW_S + 60 * n))
    flags = records.figures({})[0]["flags"]
    assert [seconds(flag["since"]) for flag in flags] == [NOW_S + 60 * n for n in range(20, MOST_FLAGS + 20)]


def log_of_a_clock(path: Path) -> Path:
    """Two robots that stand for ten minutes; from the fifth to the eighth their clocks are slow."""
    lines = []
    for second in range(600):
        t_s = NOW_S + second
        stamp_s = t_s - SLOW_S * (300 <= second < 480)
        for n, name in enumerate(("A-1", "B-1")):
            messages = [identity(name, stamp_s)] if second == 0 else []
            messages.append(status(name, stamp_s, 20.0 * n, 0.0, operationalState="idle"))
            lines += [f'{{"received":"{timestamps.write(t_s + 0.05)}","message":{raw.decode()}}}\n' for raw in messages]
    path.write_text("".join(lines))
    return path


def test_a_replay_shows_a_temporary_clock_change(tmp_path: Path) -> None:
    log = log_of_a_clock(tmp_path / "log.jsonl")
    (alder,) = scored(log, [0.3])["vendors"]
    (flag,) = alder["flags"]
    assert (flag["what"], flag["words"]) == ("clock", f"clocks {SLOW_S:.1f} s slower than usual")
    assert 290 <= seconds(flag["since"]) - NOW_S <= 330
    assert 480 <= seconds(flag["until"]) - NOW_S <= 600
    assert (alder["grade"], alder["messages"], alder["rejected"]) == ("A", 1202, 0)
