"""The rules under promtool: each alert fires where it should, and is quiet where it should be."""

import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from metrics.monitoring.alert_rules import ALERTING_RULES, OBJECTIVE_S, RECORDING_RULES
from metrics.monitoring.dashboards import rules_file

RUNBOOK = (Path(__file__).parents[3] / "docs" / "runbook.md").read_text()

needs_promtool = pytest.mark.skipif(not shutil.which("promtool"), reason="promtool is not installed")


@dataclass(frozen=True)
class Case:
    """Series by minute in promtool's notation, and whether the alert fires at a minute."""

    alert: str
    at_min: int
    fires: dict[str, str] | None
    """The labels it fires with, or None where it is quiet."""
    series: dict[str, str]


ACME = {"vendor": "Acme"}
HEALTHY = 'deconflict_messages_total{vendor="Acme",result="accepted"}'
ROBOTS = 'deconflict_robots{vendor="Acme",state="navigating"}'
DEVIATIONS = 'deconflict_deviations_total{vendor="Acme",rule="clock-off"}'
REJECTED = 'deconflict_messages_total{vendor="Acme",result="rejected"}'
OFFSET = 'deconflict_clock_offset_seconds{vendor="Acme"}'
DRIFT = 'deconflict_datum_drift_metres{vendor="Acme"}'
WORSE = 'deconflict_forecast_change_metres{vendor="Acme"}'
TRUE, IN_VAIN, NOT_JUDGED = (
    f'deconflict_vendor_warnings_judged_total{{vendor="Acme",outcome="{outcome}"}}'
    for outcome in ("came_true", "in_vain", "not_judged")
)
WITHIN = f'deconflict_message_to_advisory_seconds_bucket{{vendor="Acme",le="{OBJECTIVE_S}"}}'
EVERY = 'deconflict_message_to_advisory_seconds_count{vendor="Acme"}'
BUSY_S = "deconflict_sweep_duration_seconds_sum"
DELIVERED = 'deconflict_outlet_deliveries_total{outlet="mes"}'
FAILED = 'deconflict_outlet_failures_total{outlet="mes"}'
DEADLOCK = 'deconflict_advisories_open{kind="deadlock",severity="warning"}'
FOREIGN = 'deconflict_advisories_open{kind="foreign_claim",severity="warning"}'
TWO_PLACES = 'deconflict_advisories_open{kind="two_places",severity="warning"}'
CROWD = 'deconflict_advisories_open{kind="crowd",severity="warning"}'
SITUATIONS = 'deconflict_situations_open{{kind="knot",severity="{}"}}'
ENDS = 'deconflict_certificate_expires_timestamp_seconds{key="operator.tls.certificate"}'
BROKER = 'deconflict_broker_connected{source="hall"}'
ASIDE = 'deconflict_advisories_set_aside_total{reason="invalid"}'
PRUNED = 'deconflict_advisories_pruned_total{{reason="{}"}}'
CONFLICT = 'deconflict_advisories_open{kind="conflict",severity="warning"}'
LOST = 'deconflict_lost_seconds_total{vendor="Acme",by="Acme",kind="queue",zone="Dock"}'
THERE, EXPECTED = 'deconflict_members{part="engine"}', 'deconflict_members_expected{part="engine"}'
DAY_MIN = 1440

NOT_COMPARED = 'deconflict_robots_not_compared{vendor="Acme",fault="no map"}'

CASES = [
    Case("DeconflictRobotsNotCompared", 10, ACME | {"fault": "no map"}, {NOT_COMPARED: "2x10"}),
    Case("DeconflictRobotsNotCompared", 10, None, {NOT_COMPARED: "2x3 0x10"}),
    Case("DeconflictAbsent", 10, {}, {BUSY_S: "0+1x10"}),
    Case("DeconflictAbsent", 10, None, {'deconflict_build_info{version="1"}': "1x10"}),
    Case("DeconflictRoleDown", 5, {"role": "engine"}, {'deconflict_role_up{role="engine"}': "1 0x9"}),
    Case("DeconflictRoleDown", 5, None, {'deconflict_role_up{role="engine"}': "1 1 0 1 1 1 1"}),
    Case("DeconflictMembersMissing", 5, {"part": "engine"}, {THERE: "2x2 1x8", EXPECTED: "2x10"}),
    Case("DeconflictMembersMissing", 5, None, {THERE: "2x3 1 2x6", EXPECTED: "2x10"}),
    Case("DeconflictMembersMissing", 5, None, {THERE: "3x10", EXPECTED: "2x10"}),
    Case("DeconflictVendorSilent", 20, ACME, {HEALTHY: "0+600x5 3000x20", ROBOTS: "6x30"}),
    Case("DeconflictVendorSilent", 20, None, {HEALTHY: "0+600x30", ROBOTS: "6x30"}),
    Case("DeconflictVendorSilent", 20, ACME, {ROBOTS: "6x30"}),
    Case("DeconflictVendorSilent", 20, None, {HEALTHY: "0+600x5 3000x20", ROBOTS: "6x5 0x20"}),
    Case("DeconflictConformanceWorsening", 60, ACME, {HEALTHY: "0+600x60", REJECTED: "0+60x60"}),
    Case("DeconflictConformanceWorsening", 60, None, {HEALTHY: "0+600x60", REJECTED: "0+6x60"}),
    Case("DeconflictConformanceWorsening", 180, ACME, {HEALTHY: "0+600x200", DEVIATIONS: "0+600x130 78000+1800x70"}),
    Case("DeconflictConformanceWorsening", 180, None, {HEALTHY: "0+600x200", DEVIATIONS: "0+600x200"}),
    Case("DeconflictClockDrift", 60, ACME, {OFFSET: "-3+0.02x60"}),
    Case("DeconflictClockDrift", 60, None, {OFFSET: "-3x60"}),
    Case("DeconflictDatumDrift", 60, ACME, {DRIFT: "0.05x10 0.4x60"}),
    Case("DeconflictDatumDrift", 60, None, {DRIFT: "0.15x60"}),
    Case("DeconflictForecastsWorse", 60, ACME, {WORSE: "_x20 0.4x60"}),
    Case("DeconflictForecastsWorse", 60, None, {WORSE: "0.4x5 _x60"}),
    Case("DeconflictNuisanceRate", 90, ACME, {TRUE: "0+1x100", IN_VAIN: "0+2x100"}),
    Case("DeconflictNuisanceRate", 90, None, {TRUE: "0+2x100", IN_VAIN: "0+1x100", NOT_JUDGED: "0+9x100"}),
    Case("DeconflictNuisanceRate", 90, None, {TRUE: "0+2x100", IN_VAIN: "0+1x100"}),
    Case("DeconflictNuisanceRate", 90, None, {TRUE: "0x100", IN_VAIN: "0x60 0+0.2x40"}),
    Case("DeconflictLatencyBurnFast", 70, ACME, {EVERY: "0+600x80", WITHIN: "0+480x80"}),
    Case("DeconflictLatencyBurnFast", 70, None, {EVERY: "0+600x80", WITHIN: "0+597x80"}),
    Case("DeconflictLatencyBurnFast", 70, None, {EVERY: "0+600x80", WITHIN: "0+480x60 28800+600x20"}),
    Case("DeconflictLatencyBurnSlow", 400, ACME, {EVERY: "0+600x420", WITHIN: "0+540x420"}),
    Case("DeconflictLatencyBurnSlow", 400, None, {EVERY: "0+600x420", WITHIN: "0+596x420"}),
    Case("DeconflictEngineOverload", 20, {}, {BUSY_S: "0+54x30"}),
    Case("DeconflictEngineOverload", 20, None, {BUSY_S: "0+30x30"}),
    Case("DeconflictOutletStuck", 20, {"outlet": "mes"}, {DELIVERED: "0+3x5 15x20", FAILED: "0x5 0+1x20"}),
    Case("DeconflictOutletStuck", 20, None, {DELIVERED: "0+3x30", FAILED: "0+1x30"}),
    Case("DeconflictOutletStuck", 20, None, {DELIVERED: "0x30", FAILED: "0x30"}),
    Case("DeconflictBrokerGone", 20, {"source": "hall"}, {BROKER: "1x5 0x20"}),
    Case("DeconflictBrokerGone", 20, None, {BROKER: "1x10 0x1 1x20"}),
    Case("DeconflictRevisionSetAside", 20, {"reason": "invalid"}, {ASIDE: "0x15 1x10"}),
    Case("DeconflictRevisionSetAside", 40, None, {ASIDE: "0x15 1x30"}),
    Case("DeconflictCanaryLate", 10, {}, {"deconflict_canary_latency_seconds": "0.3x5 20+60x10"}),
    Case("DeconflictCanaryLate", 10, None, {"deconflict_canary_latency_seconds": "0.3x5 4x10"}),
    Case("DeconflictNotRecorded", 10, {}, {"deconflict_recording_failing": "0x5 1x10"}),
    Case("DeconflictNotRecorded", 10, None, {"deconflict_recording_failing": "0x5 1 0x10"}),
    Case("DeconflictCertificateEnds", 10, {"key": "operator.tls.certificate"}, {ENDS: "1000000x20"}),
    Case("DeconflictCertificateEnds", 10, None, {ENDS: "2000000x20"}),
    Case("DeconflictStoreRenewed", 10, {}, {"deconflict_store_renewed": "0x5 1x10"}),
    Case("DeconflictStoreRenewed", 4, None, {"deconflict_store_renewed": "0x5 1x10"}),
    Case("DeconflictAdvisoriesPrunedForSize", 90, {}, {PRUNED.format("size"): "0x60 0+500x40"}),
    Case(
        "DeconflictAdvisoriesPrunedForSize", 90, None, {PRUNED.format("size"): "0x100", PRUNED.format("age"): "0+9x100"}
    ),
    Case("DeconflictSituationCritical", 8, {}, {SITUATIONS.format("critical"): "0x3 1x9"}),
    Case("DeconflictSituationCritical", 8, None, {SITUATIONS.format("critical"): "0 0 1 1 0 0 0 1 1"}),
    Case("DeconflictSituationCritical", 8, None, {SITUATIONS.format("warning"): "5x9"}),
    Case(
        "DeconflictManySituations", 20, {}, {SITUATIONS.format("caution"): "6x30", SITUATIONS.format("warning"): "3x30"}
    ),
    Case(
        "DeconflictManySituations",
        20,
        None,
        {SITUATIONS.format("caution"): "6x30", SITUATIONS.format("warning"): "2x30"},
    ),
    Case("DeconflictDeadlockAhead", 5, {}, {DEADLOCK: "0x3 1x7"}),
    Case("DeconflictDeadlockAhead", 5, None, {CONFLICT: "4x10"}),
    Case("DeconflictPlaceCostsMore", 6 * DAY_MIN, {"zone": "Dock"}, {LOST: f"0+0.5x{6 * DAY_MIN - 60} 4290+10x60"}),
    Case("DeconflictPlaceCostsMore", 6 * DAY_MIN, None, {LOST: f"0+10x{6 * DAY_MIN}"}),
    Case("DeconflictPlaceCostsMore", DAY_MIN, None, {LOST: f"0+0.5x{DAY_MIN - 60} 690+10x60"}),
    Case("DeconflictForeignClaim", 5, {}, {FOREIGN: "0x3 1x7"}),
    Case("DeconflictForeignClaim", 5, None, {FOREIGN: "0x3 1 0x6", TWO_PLACES: "1x10"}),
    Case("DeconflictTwoPlaces", 5, {}, {TWO_PLACES: "0x3 1x7"}),
    Case("DeconflictTwoPlaces", 5, None, {TWO_PLACES: "0x3 1 0x6", FOREIGN: "1x10"}),
    Case("DeconflictCrowd", 5, {}, {CROWD: "0x3 1x7"}),
    Case("DeconflictCrowd", 5, None, {CROWD: "0x3 1 0x6", TWO_PLACES: "1x10"}),
]


def promtool(folder: Path, groups: list[dict[str, Any]], every_min: int = 1) -> subprocess.CompletedProcess[str]:
    (folder / "rules.yml").write_text(rules_file())
    case = folder / "case.yml"
    case.write_text(json.dumps({"rule_files": ["rules.yml"], "evaluation_interval": f"{every_min}m", "tests": groups}))
    return subprocess.run(["promtool", "test", "rules", str(case)], capture_output=True, text=True, check=False)


def group(case: Case) -> dict[str, Any]:
    """The case as promtool reads it: one sample of `ALERTING_RULES` while the alert fires, none while it is quiet."""
    labels = "".join(f',{key}="{value}"' for key, value in (case.fires or {}).items())
    asked = f'count(ALERTS{{alertname="{case.alert}",alertstate="firing"{labels}}})'
    found = [] if case.fires is None else [{"labels": "{}", "value": 1}]
    return {
        "interval": "1m",
        "input_series": [{"series": name, "values": values} for name, values in case.series.items()],
        "promql_expr_test": [{"expr": asked, "eval_time": f"{case.at_min}m", "exp_samples": found}],
    }


@needs_promtool
def test_promtool_accepts_the_output(tmp_path: Path) -> None:
    (tmp_path / "rules.yml").write_text(rules_file())
    checked = subprocess.run(
        ["promtool", "check", "rules", str(tmp_path / "rules.yml")], capture_output=True, text=True, check=False
    )
    assert checked.returncode == 0, checked.stderr
    assert f"{len(RECORDING_RULES) + len(ALERTING_RULES)} rules found" in checked.stdout


@needs_promtool
@pytest.mark.parametrize("days", [False, True], ids=["within hours", "over days"])
def test_each_alert_fires_only_when_it_should(tmp_path: Path, days: bool) -> None:
    """Cases over days are evaluated each half hour: each minute takes a minute of processor time."""
    cases = [group(case) for case in CASES if (case.at_min >= DAY_MIN) == days]
    done = promtool(tmp_path, cases, 30 if days else 1)
    assert done.returncode == 0, done.stdout + done.stderr


def test_each_alert_has_a_case_that_fires_and_one_that_is_quiet() -> None:
    names = {alert.name for alert in ALERTING_RULES}
    assert {case.alert for case in CASES if case.fires is not None} == names
    assert {case.alert for case in CASES if case.fires is None} == names


@needs_promtool
def test_an_alert_names_the_vendor_and_the_value(tmp_path: Path) -> None:
    late = next(case for case in CASES if case.alert == "DeconflictLatencyBurnFast" and case.fires)
    fields = {
        "summary": "Advisories lag behind the messages of Acme",
        "description": "Only 80% of the valid messages of Acme were reflected within 250 ms in the last hour; "
        "the objective is 99% over a month.",
        "runbook_url": "docs/runbook.md#deconflictlatencyburnfast",
    }
    asked = {
        "eval_time": f"{late.at_min}m",
        "alertname": late.alert,
        "exp_alerts": [{"exp_labels": {"vendor": "Acme", "severity": "page"}, "exp_annotations": fields}],
    }
    done = promtool(tmp_path, [{**group(late), "alert_rule_test": [asked]}])
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_runbook_has_a_section_for_each_alert_and_says_how_urgent_it_is() -> None:
    sections = dict(re.findall(r"^## (\w+)\n\n\*(\w+)\.\*", RUNBOOK, re.M))
    assert sections == {alert.name: alert.severity.capitalize() for alert in ALERTING_RULES}
