"""Report, page, export and Grafana say the same of one log: each figure, and what each of them has for it."""

import asyncio
from collections.abc import Iterator
from math import pi
from pathlib import Path
from re import findall, sub
from typing import Any, NamedTuple

import pytest
from prometheus_client.parser import text_string_to_metric_families

from deconflict.advisories.situations.situation_counts import SituationCounts
from deconflict.operator.blackbox.start_state import StartState
from deconflict.operator.ledger.loss_ledger import LedgerEntry, LossLedger
from deconflict.settings.site import Site
from deconflict_client.situations import AnyRevision
from ingest.languages.timestamps import write
from ingest.measures.measures import Measures
from ingest.recording.log_reader import LogReader
from ingest.settings import Datum, Vendor
from metrics.export.ledger_commands import write_days
from metrics.monitoring.exposition import render
from metrics.replay.engine_run import EngineRun
from metrics.replay.log_scores import LogScores
from metrics.replay.recorded_passes import PassReader
from metrics.report.html_report import page
from metrics.report.replay_summary import summary
from metrics.scoring.warnings import warning_judge
from metrics.scoring.warnings.warning_judge import AHEAD_BOUNDS_S, WarningJudge
from metrics.scoring.warnings.warning_quality import WarningQuality
from tests.deconflict.operator.http.served_face import served
from tests.helpers.plain_http import http_client
from tests.helpers.saying import HALL, identity, points, status

NOW_S, CROSSES_S, ENDS_S, QUIET_UNTIL_S = 1_790_000_000.0, 12, 26, 110
SITE = Site(datums=(Datum(id=HALL, name="Hall"),), vendors=(Vendor(name="Cedar", participant="person"),))
SCENES = ("expected", "expected", "unexpected", "turns off", "waits")
PEOPLE = "C-0", "C-1", "C-2"
"""They walk far from all robots."""
Figure = float | None


def place(scene: str, is_second: bool, t_s: float) -> tuple[float, float, float]:
    """Where a robot of a scene is: along its way, and beside it."""
    along_m = min(t_s, ENDS_S) - CROSSES_S
    if is_second and scene == "turns off" and t_s > CROSSES_S - 5:
        return -5.0, -(min(t_s, ENDS_S) - CROSSES_S + 5), pi
    if is_second and scene == "unexpected" and t_s < CROSSES_S:
        along_m = -1.5
    if is_second and scene == "waits":
        along_m = min(along_m, max(-3.0, along_m - 6))
    return along_m, 0.0, pi / 2 if is_second else 0.0


def messages() -> Iterator[tuple[float, bytes]]:
    names = [f"{vendor}-{number}" for number in range(len(SCENES)) for vendor in "AB"]
    for name in names:
        yield NOW_S, identity(name, NOW_S, manufacturerName={"A": "Alder", "B": "Basalt"}[name[0]])
    for name in PEOPLE:
        yield NOW_S, identity(name, NOW_S, manufacturerName="Cedar")
    for second in range(QUIET_UNTIL_S):
        for number, name in enumerate(PEOPLE):
            yield NOW_S + second, status(name, NOW_S + second, 900.0, 50.0 * number + min(second, ENDS_S), pi / 2)
        for number, scene in enumerate(SCENES):
            for is_second, vendor in enumerate("AB"):
                yield NOW_S + second, reported(f"{vendor}-{number}", scene, bool(is_second), second, 60.0 * number)


def reported(name: str, scene: str, is_second: bool, second: float, x0_m: float) -> bytes:
    def at(t_s: float) -> tuple[float, float, float]:
        along_m, aside_m, yaw_rad = place(scene, is_second, t_s)
        return (x0_m + aside_m, along_m, yaw_rad) if is_second else (x0_m + along_m, aside_m, yaw_rad)

    def expected(t_s: float) -> tuple[float, float, float]:
        """Until it turns off, nobody knows of it."""
        known = scene != "turns off" or not is_second or second > CROSSES_S - 5
        return at(t_s) if known else (x0_m, t_s - CROSSES_S, pi / 2)

    path = points(*((NOW_S + second + i, *expected(second + i)) for i in range(1, 11)))
    lists: dict[str, Any] = {"operationalState": "idle"} if scene == "unexpected" else {"path": path}
    return status(name, NOW_S + second, *at(second), **lists)


class Surfaces(NamedTuple):
    """What each surface has of one run."""

    result: dict[str, Any]
    html: str
    grafana: dict[str, float]
    """By metric and the values of its labels in the order of their names."""
    page: dict[str, Any]
    """By path, what the page reads."""
    exported_lost_s: float
    triggered: int
    """Pairs of which a black box would be kept."""


SHIFT, ENDED, LOST = (
    "/shift?since_s=0",
    "/advisories?state=all&kind=conflict&limit=1000",
    "/losses?from_s=0&until_s=2000000000",
)


async def read_by_page(folder: Path, revisions: list[AnyRevision], losses: list[LedgerEntry]) -> dict[str, Any]:
    async with served(folder) as face, http_client() as client:
        await face.publish(*revisions)
        face.sources.ledger.add("engine", 1, losses)
        return {path: (await client.get(face.http + path)).json() for path in (SHIFT, ENDED, LOST)}


def run(folder: Path) -> Surfaces:
    log = folder / "log.jsonl"
    log.write_text(
        "".join(f'{{"received":"{write(t_s + 0.05)}","message":{raw.decode()}}}\n' for t_s, raw in messages())
    )
    conflict, passes, measures, counts = SITE.conflict, PassReader(SITE), Measures(), SituationCounts()
    engine, scores = EngineRun(SITE, conflict.clearance_m, StartState()), LogScores(SITE, [conflict.clearance_m])
    judge, ledger = WarningJudge(conflict.clearance_m, conflict.clear_margin_m, measures), LossLedger(None, SITE.losses)
    revisions: list[AnyRevision] = []
    losses: list[LedgerEntry] = []
    triggered = 0
    for number, each in enumerate(passes.passes_of(LogReader().read([log]))):
        output = engine.advance(each)
        judge.add(each.now_s, each.batch, output.bands_m, output.advisories, output.waiting)
        scores.add(each, [output])
        revisions += [*output.advisories, *output.situations]
        losses += output.losses
        triggered += len(engine.engine.near_misses)
        counts.count(measures, output.situations)
        ledger.add("engine", number + 1, list(output.losses))
    result = scores.result(passes, engine.measures())
    text, _ = render([passes.measures(), engine.measures(), measures.as_document()])
    grafana = {
        " ".join((sample.name, *(value for _, value in sorted(sample.labels.items())))): sample.value
        for family in text_string_to_metric_families(text.decode())
        for sample in family.samples
    }
    exported = sum(float(sub(".*rows?, ", "", line).split()[0]) for line in write_days(ledger, folder, {}))
    ledger.close()
    read = asyncio.run(read_by_page(folder, revisions, losses))
    return Surfaces(result, page(result, "Log", SITE), grafana, read, exported, triggered)


@pytest.fixture(scope="module")
def surfaces(tmp_path_factory: pytest.TempPathFactory) -> Surfaces:
    return run(tmp_path_factory.mktemp("run"))


def table_row(html: str, first: str) -> list[str]:
    """The cells of the first row of a table that begins with this cell."""
    row, *_ = findall(f"<tr><td>{first}</td>(.*?)</tr>", html)
    return findall(r"<td class=n>([^<]*)</td>", row)


def html_figures(html: str) -> dict[str, Figure]:
    """Of the first table of qualities."""
    cells = [cell.split(" ")[0].replace(",", "") for cell in table_row(html, f"{SITE.conflict.clearance_m:g} m")[:9]]
    names = ("events", "warned of", "ahead by", "warnings", "came true", "in vain", "not judged")
    return {name: float(cell) for name, cell in zip(names, cells, strict=False)}


def lost_in_html(html: str) -> Figure:
    """By the sentence of the first page."""
    return float(*findall(r"Robots and people lost (\d+) s to each other", html))


def of_metric(grafana: dict[str, float], name: str, label: str = "") -> float:
    """The sum over all labels, of which one is this."""
    return sum(value for series, value in grafana.items() if series.split(" ")[0] == name and label in series)


def figures(surfaces: Surfaces) -> dict[str, dict[str, Figure]]:
    """Each figure, and what each surface has for it."""
    result, grafana, html = surfaces.result, surfaces.grafana, html_figures(surfaces.html)
    quality = WarningQuality.of(result["scores"][0]["warnings"])
    warnings, events = "deconflict_warnings_judged_total", "deconflict_events_judged_total"
    table: dict[str, dict[str, Figure]] = {
        "events": {"JSON": quality.events, "HTML": html["events"], "Grafana": of_metric(grafana, events)},
        "warned of": {"JSON": quality.warned_of, "HTML": html["warned of"], "Grafana": grafana[f"{events} yes"]},
        "warnings": {"JSON": quality.warnings, "HTML": html["warnings"], "Grafana": of_metric(grafana, warnings)},
        "raised": {
            "JSON": quality.warnings,
            "JSON, by kind": result["advisories_raised"]["conflict"],
            "page": len(surfaces.page[ENDED]["advisories"]),
            "Grafana": grafana["deconflict_advisories_total raised conflict"],
        },
        "situations": {
            "JSON": result["situations"]["situations"],
            "shift": len(surfaces.page[SHIFT]["situations"]),
            "shift, by kind": sum(surfaces.page[SHIFT]["counts"].values()),
            "Grafana": sum(
                v for k, v in grafana.items() if k.startswith("deconflict_situations_total") and "raised" in k
            ),
        },
        "robots": {"JSON": result["robots"], "Grafana": of_metric(grafana, "deconflict_robots")},
        "people": {
            "JSON": result["participants"]["person"],
            "HTML": float(*findall(r"robots, (\d+) people of", surfaces.html)),
            "terminal": float(*findall(r"robots, (\d+) people of", summary(result, ()))),
            "Grafana": of_metric(grafana, "deconflict_robots", "Cedar"),
        },
        "near misses": {
            "JSON": sum(each["separation_m"] <= SITE.conflict.clearance_m for each in result["nearest"]),
            "HTML": surfaces.html.count("Two envelopes where they were nearest"),
            "black boxes": surfaces.triggered,
            "Grafana": grafana["deconflict_near_misses_total"],
        },
        "lost, s": {
            "JSON": round(result["losses"]["total"]["lost_s"]),
            "page": round(surfaces.page[LOST]["total"]["lost_s"]),
            "HTML": lost_in_html(surfaces.html),
            "export": surfaces.exported_lost_s,
            "Grafana": round(of_metric(grafana, "deconflict_lost_seconds_total")),
        },
    }
    for name, value in zip(("came_true", "in_vain", "not_judged"), quality[7:10], strict=True):
        words = name.replace("_", " ")
        table[words] = {"JSON": value, "HTML": html[words], "Grafana": grafana[f"{warnings} {name}"]}
    return table


def contradictions(surfaces: Surfaces) -> dict[str, dict[str, Figure]]:
    return {name: values for name, values in figures(surfaces).items() if len(set(values.values())) > 1}


def test_no_two_surfaces_have_another_figure(surfaces: Surfaces) -> None:
    assert contradictions(surfaces) == {}


def test_the_log_has_something_of_each(surfaces: Surfaces) -> None:
    found = figures(surfaces)
    assert all(
        found[name]["JSON"] for name in ("warned of", "came true", "in vain", "situations", "lost, s", "near misses")
    )
    assert found["people"]["JSON"] == len(PEOPLE)
    assert found["events"]["JSON"] != found["warned of"]["JSON"], "one event without a warning"


def test_ahead_by_is_the_same_to_within_the_steps_of_the_histogram(surfaces: Surfaces) -> None:
    quality = WarningQuality.of(surfaces.result["scores"][0]["warnings"])
    assert quality.ahead_by_s
    median_s = quality.ahead_by_s["median"]
    counts = {
        float(series.split(" ")[1]): value
        for series, value in surfaces.grafana.items()
        if series.startswith("deconflict_warned_ahead_seconds_bucket")
    }
    half = counts[float("inf")] / 2
    reached = min(bound for bound, count in counts.items() if count >= half)
    below = max((bound for bound in AHEAD_BOUNDS_S if bound < reached), default=0.0)
    assert counts[float("inf")] == quality.warned_of
    assert below <= median_s <= reached + 1.0
    assert abs((html_figures(surfaces.html)["ahead by"] or 0.0) - median_s) <= 0.051


def test_each_vendor_has_the_figures_of_the_report(surfaces: Surfaces) -> None:
    for row in surfaces.result["scores"][0]["warnings"]["by_vendor"]:
        quality, name = WarningQuality.of(row), row["vendor"]
        in_grafana = [
            surfaces.grafana[f"deconflict_vendor_warnings_judged_total {outcome} {name}"]
            for outcome in ("came_true", "in_vain", "not_judged")
        ]
        assert in_grafana == [quality.came_true, quality.in_vain, quality.not_judged], name
        assert surfaces.grafana[f"deconflict_vendor_events_judged_total {name} yes"] == quality.warned_of, name


def test_a_surface_that_counts_otherwise_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(warning_judge, "outcome_of", lambda _: "in_vain")
    assert {"came true", "in vain"} <= set(contradictions(run(tmp_path)))
