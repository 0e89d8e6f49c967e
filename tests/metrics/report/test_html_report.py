import copy
import re
import xml.etree.ElementTree as ET
from datetime import datetime
from html import escape
from math import dist
from pathlib import Path
from typing import Any

import pytest

from deconflict.settings.site import DEFAULT
from deconflict.settings.site_file import load
from deconflict.simulation.demo.demo_site import demo_site
from ingest.recording.log_reader import LogReader
from metrics.replay.replay import replay
from metrics.report.drawings import figures
from metrics.report.drawings.svg import Chart, ticks
from metrics.report.html_report import page
from metrics.report.opening_sections import DrawnFloor, floor_picture
from metrics.report.replay_summary import findings, first_sentences, place_texts, summary
from tests.metrics.replay.made_replays import NOW_S, log_of_a_crossing, scored


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder: Path = tmp_path_factory.mktemp("log")
    return scored(log_of_a_crossing(folder / "log.jsonl"), [0.3])


def test_the_page_opens_offline_and_is_the_same_each_time(result: dict[str, Any]) -> None:
    html = page(result, "Replay")
    assert html == page(copy.deepcopy(result), "Replay")
    for outside in ("http", "src=", "@import", "url(", "<script"):
        assert outside not in html
    for part in ("lead time", "Where", "The course of the log", "Deviations from", "Distance from forecast"):
        assert part in html


def test_names_from_vendors_are_shown_as_text(result: dict[str, Any]) -> None:
    hostile = copy.deepcopy(result)
    name = '<script>alert("1")</script>'
    for vendor in (*hostile["scores"][0]["by_vendor"], *hostile["conformance"], *hostile["forecast_error"]["by_model"]):
        vendor["vendor"] = name
    for vendor in hostile["nearest"]:
        vendor["vendors"] = vendor["names"] = [name, name]
        vendor["floor_name"] = name
    for vendor in hostile["vendors"]:
        vendor["vendor"] = name
    html = page(hostile, name)
    assert "<script" not in html
    assert "&lt;script&gt;" in html


def test_a_log_in_which_nothing_happened_has_a_page() -> None:
    html = page(replay(LogReader(), [], DEFAULT, [0.3]), "Replay")
    assert "No two robots came near each other" in html
    assert "No deviations from the standard" in html


def test_messages_out_of_order_are_mentioned_if_there_are_any(result: dict[str, Any]) -> None:
    note = "3 messages come after messages that were received up to 0.5 s later"
    assert note in page({**result, "late_messages": 3, "late_by_s": 0.5}, "Replay")
    assert "come after messages" not in page(result, "Replay")


def test_the_nearest_moment_is_where_the_two_crossed(result: dict[str, Any]) -> None:
    moment = result["nearest"][0]
    assert moment["separation_m"] == 0.0
    at = [tuple(map(float, track.split(";")[moment["nearest"]].split()[:2])) for track in moment["tracks"]]
    assert [abs(value) < 0.2 for place in at for value in place] == [True] * 4
    assert moment["warned_s"] > 7
    assert moment["warned_until_s"] is None
    assert (abs(moment["x_m"]) < 0.5, abs(moment["y_m"]) < 0.5) == (True, True)


def test_the_nearest_moment_is_shown_with_its_time_place_names_and_a_scale(result: dict[str, Any]) -> None:
    moment = result["nearest"][0]
    assert datetime.fromisoformat(moment["at"]).timestamp() == pytest.approx(moment["at_s"], abs=1e-3)
    assert moment["into_s"] == pytest.approx(moment["at_s"] - NOW_S, abs=0.11)
    assert sorted(moment["names"]) == ["Alder A-1", "Alder B-1"]
    html = page(result, "Replay")
    where = f"x {moment['x_m']:.1f}, y {moment['y_m']:.1f}"
    for part in ("Alder A-1", "Alder B-1", f"{moment['at'][:10]} {moment['at'][11:19]} UTC", "s into the log", where):
        assert part in html
    root = ET.fromstring(figures.scene(moment))  # noqa: S314 - our own text
    (label,), (bar,) = ([mark for mark in root.iter() if mark.tag == tag] for tag in ("text", "path"))
    begin, end = re.fullmatch(r"M(\S+) \S+V\S+H(\S+)V\S+", bar.attrib["d"]).groups()  # type: ignore[union-attr]
    envelope = next(mark for mark in root.iter("polygon") if mark.attrib["class"].startswith("envelope"))
    corners = [tuple(map(float, corner.split(","))) for corner in envelope.attrib["points"].split()]
    metre = dist(corners[0], corners[1]) / moment["sizes_m"][0][0]
    assert label.text == f"{(float(end) - float(begin)) / metre:.0f} m"


@pytest.mark.parametrize(
    ("warned_s", "until_s", "expected"),
    [
        (None, None, "without a warning in the 10 s before"),
        (8.1, None, "warned of 8.1 s ahead, still open"),
        (8.1, 2.0, "warned of 8.1 s ahead, cleared 2.0 s before"),
    ],
)
def test_a_moment_shows_whether_its_advisory_was_cleared(
    result: dict[str, Any], warned_s: float | None, until_s: float | None, expected: str
) -> None:
    changed = copy.deepcopy(result)
    for each in changed["nearest"]:
        each.update(warned_s=warned_s, warned_until_s=until_s)
    assert expected in page(changed, "Replay")


def test_the_scorecard_shows_how_reliable_a_vendor_is(result: dict[str, Any]) -> None:
    changed = copy.deepcopy(result)
    (vendor,) = changed["vendors"]
    assert "No vendor's forecasts, positions or clocks changed" in page(changed, "Replay")
    flag = {"what": "clock", "since": "2026-11-22T08:00:00Z", "by": -3.0, "words": "clocks 3.0 s faster than usual"}
    vendor.update(grade="C", grade_words="so and so", flags=[flag | {"until": None}], forecasts_distrusted=4321)
    vendor["coverage"] = [{"share": share, "covered": share + 0.01} for share in (0.5, 0.8, 0.9)]
    html = page(changed, "Replay")
    for part in (
        "so and so",
        "clocks 3.0 s faster",
        "2026-11-22 08:00:00 UTC",
        "the end",
        "4,321",
        "0.51 / 0.81 / 0.91",
    ):
        assert part in html


def test_drawings_are_well_formed_and_lie_within_their_bounds() -> None:
    bins = [{"samples": 10 * n, "probability": n / 10, "came_true": n / 11} for n in range(1, 10)]
    warnings = [((x / 3, x / 7), "yn-"[x % 3]) for x in range(60)]
    wall = ("obstacle", "wall", [(-1.0, -1.0), (30.0, -1.0), (30.0, 12.0)])
    floor = DrawnFloor("Hall", [wall], warnings, [("dot missed", "m1", (40.0, 3.0), "M1")])
    minutes = [
        {"at_s": 60.0 * n, "true": n, "in_vain": 1, "other": 2, "warned": n % 7, "missed": 3} for n in (0, 1, 5, 500)
    ]
    drawings = (figures.reliability(bins), figures.lead_times([0.5, 3.0, 40.0]), figures.timeline(minutes))
    corner = DrawnFloor("Hall", warnings=[((9.5, -0.5), "y"), ((10.5, 0.5), "y")])
    for drawing in (*drawings, floor_picture(floor), floor_picture(corner)):
        root = ET.fromstring(drawing)  # noqa: S314 - our own text
        width, height = float(root.attrib["width"]), float(root.attrib["height"])
        for circle in root.iter("circle"):
            assert 0 <= float(circle.attrib["cx"]) <= width
        for box in root.iter("rect"):
            assert 0 <= float(box.attrib["x"]) <= width - float(box.attrib["width"])
            assert 0 <= float(box.attrib["y"]) <= height - float(box.attrib["height"])


def test_the_diagonal_of_a_chart_goes_from_corner_to_corner() -> None:
    chart = Chart((0.0, 2.0), (0.0, 4.0), width=100, height=100, margin=(10, 10, 10, 10))
    assert [chart.at(0, 0), chart.at(2, 4), chart.at(1, 2)] == [(10, 90), (90, 10), (50, 50)]


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [(0.0, 1.0, [0, 0.2, 0.4, 0.6, 0.8, 1.0]), (-3.0, 17.0, [0, 5, 10, 15]), (2.0, 2.0, [2.0])],
)
def test_ticks_are_round_numbers_within(low: float, high: float, expected: list[float]) -> None:
    assert list(ticks(low, high)) == expected


def test_the_report_begins_with_a_sentence_for_a_meeting_that_the_terminal_shows_too(result: dict[str, Any]) -> None:
    sentence = first_sentences(result)
    assert sentence == (
        "In 0.4 minutes, 2 robots of 1 vendor got in each other's way once. The service warned of 1 of these (100 %),"
        " of 1 at least 2 s ahead. Of its 1 warning, 1 came true, 0 were in vain and 0 are not judged."
    )
    assert page(result, "Replay").index(escape(sentence)) < page(result, "Replay").index("<h2>")
    assert summary(result, [Path("out.json")]).splitlines()[:: len(list(findings(result))) + 1] == [
        sentence,
        "Wrote out.json",
    ]


def test_every_column_says_what_it_means_on_hover_and_at_the_end(result: dict[str, Any]) -> None:
    html = page(result, "Replay")
    columns = re.findall(r"<th title=\"(.*?)\">(.*?)</th>", html)
    assert len(columns) == html.count("<th ") > 20
    assert "<th>" not in html
    for meaning, title in columns:
        assert not title or f"<dt>{title}</dt><dd>{meaning}</dd>" in html


def test_a_log_that_was_warned_of_at_the_wrong_place_lists_what_was_missed_and_what_was_in_vain(
    result: dict[str, Any],
) -> None:
    changed = copy.deepcopy(result)
    names = {"names": ["Alder A-1", "<b>"], "vendors": ["Alder", "Alder"], "robots": ["a", "b"]}
    where = {"floor": "hall", "floor_name": "Hall", "x_m": 3.0, "y_m": 4.0}
    case = {"at": "2026-11-23T23:10:04.000000Z", "into_s": 28.0, **names, **where}
    warning = {
        "advisory": "1",
        "open_s": 4.0,
        "predicted_in_s": 3.0,
        "encounter_class": "head_on",
        "verdict": "kept_apart",
    }
    listed = changed["scores"][0]["warnings"]["listed"]
    listed.update(missed=[{**case, "event": "stop"}], in_vain=[{**case, **warning}], in_vain_left_out=7)
    html = page(changed, "Replay", page_url="http://hall:8080/")
    assert "Warnings in vain: 8, the first 1 of them" in html
    for row in ("m1", "v1"):
        assert f'<tr id="{row}">' in html
        assert f'<a href="#{row}"><circle id="dot-{row}"' in html
        assert f'<a href="#dot-{row}">' in html
    assert 'href="http://hall:8080/#at=2026-11-23T23%3A10%3A04.000000Z&amp;floor=hall"' in html
    assert "<b>" not in html.split("What to look into")[1]


def test_cases_are_placed_in_the_names_of_the_site() -> None:
    site = load(demo_site())
    case = {"floor": site.datums[0].id, "floor_name": "Ground hall", "x_m": 72.3, "y_m": 28.6}
    cases = [case, {**case, "floor": "other", "floor_name": ""}, {**case, "x_m": None, "y_m": None}]
    assert place_texts(site, cases) == [
        "where Aisle 7 meets Upper cross aisle on Ground hall",
        "near (72.3, 28.6)",
        "-",
    ]
