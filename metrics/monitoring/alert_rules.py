"""Recording and alerting rules for Prometheus, built from the catalogue. `docs/runbook.md` explains each alert."""

from dataclasses import dataclass
from typing import Literal

from metrics.monitoring.promql import increase, increase_before, level, rate, share_within, time_share
from metrics.monitoring.queries import VENDOR, judged, share_in_vain

OBJECTIVE_S = 0.25
"""The objective: a valid status is reflected in the advisories within this time (`docs/metrics.md`)."""
OBJECTIVE_SHARE = 0.99
"""Share of valid statuses for which this must hold, over 30 days."""
CANARY_LATE_S = 10
MOST_SITUATIONS = 8
"""More open situations at once nobody can follow."""
RUNBOOK = "docs/runbook.md"


@dataclass(frozen=True, slots=True)
class RecordingRule:
    """A query that Prometheus evaluates continuously and stores under a name."""

    name: str
    query: str


@dataclass(frozen=True, slots=True)
class AlertingRule:
    """A condition that a person should know about. Summary and description are Prometheus templates."""

    name: str
    query: str
    lasting: str
    """How long the condition must hold before the alert fires."""
    severity: Literal["page", "ticket"]
    summary: str
    description: str

    @property
    def section(self) -> str:
        """The section of the runbook about this alert."""
        return f"{RUNBOOK}#{self.name.lower()}"


def _within(window: str) -> RecordingRule:
    name = f"vendor:deconflict_within_objective:ratio_rate{window}"
    return RecordingRule(name, share_within(OBJECTIVE_S, "deconflict_message_to_advisory_seconds", window, VENDOR))


def _burning(long: str, short: str, times: float) -> str:
    """Both windows miss the objective so often that the month's error budget is spent `times` too fast.

    Multiwindow burn rates: Google, The Site Reliability Workbook, chapter 5.
    """
    bound = round(1 - times * (1 - OBJECTIVE_SHARE), 6)
    return " and ".join(f"vendor:deconflict_within_objective:ratio_rate{window} < {bound}" for window in (long, short))


def _late(window: str) -> str:
    return (
        "Only {{ $value | humanizePercentage }} of the valid messages of {{ $labels.vendor }} were reflected within "
        f"{OBJECTIVE_S * 1000:.0f} ms in the last {window}; the objective is {OBJECTIVE_SHARE:.0%} over a month."
    )


_LOST = "deconflict_lost_seconds_total"
_MESSAGES = rate("deconflict_messages_total", "15m", VENDOR)
_OFFSET = "deconflict_clock_offset_seconds"

RECORDING_RULES = (
    RecordingRule(
        "vendor:deconflict_accepted:rate5m",
        rate("deconflict_messages_total", "5m", VENDOR, where={"result": "accepted"}),
    ),
    RecordingRule(
        "vendor:deconflict_deviations_per_message:ratio_rate15m",
        f"{rate('deconflict_deviations_total', '15m', VENDOR)} / {_MESSAGES}",
    ),
    RecordingRule(
        "vendor:deconflict_rejected:ratio_rate15m",
        f"({rate('deconflict_messages_total', '15m', VENDOR, where={'result': 'rejected'})} or 0 * {_MESSAGES})"
        f" / {_MESSAGES}",
    ),
    *(_within(window) for window in ("5m", "30m", "1h", "6h")),
    RecordingRule(
        "vendor:deconflict_in_vain:ratio_increase1h",
        share_in_vain("1h", VENDOR),
    ),
    RecordingRule("deconflict:engine_busy:ratio_rate5m", time_share("deconflict_sweep_duration_seconds", "5m")),
)

ALERTING_RULES = (
    AlertingRule(
        "DeconflictAbsent",
        "absent(deconflict_build_info)",
        "1m",
        "page",
        "The deconfliction service is absent",
        "Prometheus has read nothing from the service for a minute. Nobody is warned of conflicts.",
    ),
    AlertingRule(
        "DeconflictRoleDown",
        f"{level('deconflict_role_up', ['role'], over='min')} == 0",
        "1m",
        "page",
        "The {{ $labels.role }} of the deconfliction service is down",
        "The {{ $labels.role }} has not answered for a minute. Without receiver or engine no advisory changes.",
    ),
    AlertingRule(
        "DeconflictMembersMissing",
        f"{level('deconflict_members', ['part'], over='min')}"
        f" < {level('deconflict_members_expected', ['part'], over='max')}",
        "1m",
        "page",
        "A part of the cluster lacks members: {{ $labels.part }}",
        "Of this part only {{ $value }} members have been there for a minute, fewer than expected. members of "
        "GET /healthz names those that are missing. What they did is lost or done by the others; if one more dies, "
        "nobody may do it.",
    ),
    AlertingRule(
        "DeconflictVendorSilent",
        f"{level('deconflict_robots', VENDOR)} > 0 unless on (vendor) vendor:deconflict_accepted:rate5m > 0",
        "1m",
        "page",
        "No robot of {{ $labels.vendor }} sends valid messages",
        "{{ $value }} robots of {{ $labels.vendor }} are on the floor and none has sent a valid message for five "
        "minutes. They are treated as obstacles where they were last seen.",
    ),
    AlertingRule(
        "DeconflictRobotsNotCompared",
        f"{level('deconflict_robots_not_compared', ['vendor', 'fault'])} > 0",
        "5m",
        "ticket",
        "Robots of {{ $labels.vendor }} are compared with nobody: {{ $labels.fault }}",
        "{{ $value }} robots of {{ $labels.vendor }} are heard, and nobody is warned of them: {{ $labels.fault }}.",
    ),
    AlertingRule(
        "DeconflictConformanceWorsening",
        "vendor:deconflict_rejected:ratio_rate15m > 0.05 or vendor:deconflict_deviations_per_message:ratio_rate15m"
        " > 0.2 + 1.5 * avg_over_time(vendor:deconflict_deviations_per_message:ratio_rate15m[1d] offset 30m)",
        "10m",
        "ticket",
        "Messages of {{ $labels.vendor }} conform less than before",
        '{{ $labels.vendor }} now has {{ printf "%.2f" $value }} rejections or deviations per message: more than one '
        "message in twenty is rejected, or there are over 1.5 times as many deviations as on the day before.",
    ),
    AlertingRule(
        "DeconflictClockDrift",
        f"max_over_time({_OFFSET}[1h]) - min_over_time({_OFFSET}[1h]) > 0.5",
        "5m",
        "ticket",
        "The clocks of {{ $labels.vendor }} drift",
        'The estimated clock offset of {{ $labels.vendor }} has moved by {{ printf "%.2f" $value }} s within an hour. '
        "A constant offset is corrected. A changing offset makes forecasts early or late.",
    ),
    AlertingRule(
        "DeconflictDatumDrift",
        f"{level('deconflict_datum_drift_metres', VENDOR, over='max')} > 0.2",
        "30m",
        "ticket",
        "The coordinate frame of {{ $labels.vendor }} has drifted",
        'Robots of {{ $labels.vendor }} now stop at docks and chargers {{ printf "%.2f" $value }} m from where '
        "they stopped at first. Their positions and forecasts have the same error.",
    ),
    AlertingRule(
        "DeconflictForecastsWorse",
        level("deconflict_forecast_change_metres", VENDOR, over="max") + " > 0",
        "10m",
        "ticket",
        "Forecasts of {{ $labels.vendor }} have become worse",
        'The error of forecasts of {{ $labels.vendor }} 3 s ahead is {{ printf "%.2f" $value }} m larger than usual. '
        "Its conflicts are predicted with wider errors: warnings come later, or needlessly.",
    ),
    AlertingRule(
        "DeconflictNuisanceRate",
        f"vendor:deconflict_in_vain:ratio_increase1h > 0.5 and on (vendor) ({judged('1h', VENDOR)} > 10)",
        "15m",
        "ticket",
        "Most warnings of robots of {{ $labels.vendor }} are in vain",
        "{{ $value | humanizePercentage }} of the warnings of robots of {{ $labels.vendor }} that were judged in the "
        "last hour were in vain. Those that are not judged do not count.",
    ),
    AlertingRule(
        "DeconflictLatencyBurnFast",
        _burning("1h", "5m", 14.4),
        "2m",
        "page",
        "Advisories lag behind the messages of {{ $labels.vendor }}",
        _late("hour"),
    ),
    AlertingRule(
        "DeconflictLatencyBurnSlow",
        _burning("6h", "30m", 6.0),
        "15m",
        "ticket",
        "Advisories repeatedly lag behind the messages of {{ $labels.vendor }}",
        _late("six hours"),
    ),
    AlertingRule(
        "DeconflictEngineOverload",
        "deconflict:engine_busy:ratio_rate5m > 0.8",
        "5m",
        "page",
        "The engine is close to overload",
        "The engine computes {{ $value | humanizePercentage }} of the time. Near 100 % its passes are late and "
        "messages are replaced before they are read.",
    ),
    AlertingRule(
        "DeconflictOutletStuck",
        f"{rate('deconflict_outlet_failures_total', '5m', ['outlet'])} > 0"
        f" unless on (outlet) {rate('deconflict_outlet_deliveries_total', '5m', ['outlet'])} > 0",
        "5m",
        "ticket",
        "The outlet {{ $labels.outlet }} accepts no advisories",
        "Nothing has been delivered to {{ $labels.outlet }} for five minutes and attempts fail; advisories wait.",
    ),
    AlertingRule(
        "DeconflictBrokerGone",
        "deconflict_broker_connected == 0",
        "2m",
        "page",
        "The broker {{ $labels.source }} can't be heard",
        "No message of the robots at {{ $labels.source }} arrives. They drive on, and are treated as silent.",
    ),
    AlertingRule(
        "DeconflictRevisionSetAside",
        f"{increase('deconflict_advisories_set_aside_total', '15m', ['reason'])} > 0",
        "0s",
        "ticket",
        "Revisions of advisories are set aside",
        '{{ printf "%.0f" $value }} revisions of advisories or situations were set aside in the last 15 minutes '
        "({{ $labels.reason }}). Nobody receives them. The log of the role names each, with the reason.",
    ),
    AlertingRule(
        "DeconflictAdvisoriesPrunedForSize",
        f"{increase('deconflict_advisories_pruned_total', '1d', where={'reason': 'size'})} > 0",
        "0s",
        "ticket",
        "The database of advisories is full",
        '{{ printf "%.0f" $value }} cleared advisories were removed in the last day to keep the database within '
        "store.advisories_bytes. They are younger than store.keep_days.",
    ),
    AlertingRule(
        "DeconflictCanaryLate",
        f"{level('deconflict_canary_latency_seconds')} > {CANARY_LATE_S}",
        "30s",
        "page",
        "Warnings do not come through",
        "A made-up conflict takes {{ $value }} s from its messages to the store. Warnings of real ones may be as late.",
    ),
    AlertingRule(
        "DeconflictNotRecorded",
        f"{level('deconflict_recording_failing')} > 0",
        "1m",
        "ticket",
        "Messages are not recorded",
        "For a minute nothing could be recorded. Warnings go on; replays and black boxes of this time will be missing.",
    ),
    AlertingRule(
        "DeconflictStoreRenewed",
        f"{level('deconflict_store_renewed')} > 0",
        "0s",
        "ticket",
        "The database of advisories was damaged or gone",
        "A new one was begun with what could be read. GET /healthz says what happened, and names the old file.",
    ),
    AlertingRule(
        "DeconflictCertificateEnds",
        f"{level('deconflict_certificate_expires_timestamp_seconds', ['key'], over='min')} - time() < 14 * 86400",
        "1m",
        "ticket",
        "A certificate ends soon",
        "A certificate of {{ $labels.key }} ends in {{ $value | humanizeDuration }}. Then connections are refused.",
    ),
    AlertingRule(
        "DeconflictSituationCritical",
        f"{level('deconflict_situations_open', where={'severity': 'critical'})} > 0",
        "2m",
        "page",
        "A situation on the floor stays critical",
        "For two minutes situations have been critical, now {{ $value }}. GET /situations?severity=critical says what "
        "goes on, and what to do first.",
    ),
    AlertingRule(
        "DeconflictManySituations",
        f"{level('deconflict_situations_open')} > {MOST_SITUATIONS}",
        "5m",
        "ticket",
        "More situations are open than people can follow",
        f"For five minutes more than {MOST_SITUATIONS} situations were open, now {{{{ $value }}}}. "
        "GET /situations lists them, the newest first.",
    ),
    AlertingRule(
        "DeconflictDeadlockAhead",
        f"{level('deconflict_advisories_open', where={'kind': 'deadlock'})} > 0",
        "0s",
        "page",
        "Robots block each other now or soon",
        "{{ $value }} deadlock advisories are open. GET /advisories?kind=deadlock names the robots and "
        "who waits for whom.",
    ),
    AlertingRule(
        "DeconflictPlaceCostsMore",
        f"{increase(_LOST, '1h', ['zone'])} > 2 * {increase_before(_LOST, '5d', '1h', ['zone'])} / 120"
        f" and on (zone) {increase(_LOST, '1h', ['zone'])} > 300"
        f" and on (zone) {increase_before(_LOST, '1d', '4d', ['zone'])} > 0",
        "0s",
        "ticket",
        "A place costs twice its usual",
        "Robots lost {{ $value | humanizeDuration }} to each other at {{ $labels.zone }} in an hour, more than twice "
        "what is usual there. GET /losses?group=vendor,by,kind names whose robots were in whose way.",
    ),
    AlertingRule(
        "DeconflictForeignClaim",
        f"{level('deconflict_advisories_open', where={'kind': 'foreign_claim'})} > 0",
        "0s",
        "ticket",
        "A vendor reports robots of another vendor",
        "{{ $value }} times a vendor reports robots that belong to another. These reports are refused and change "
        "no forecast. GET /advisories?kind=foreign_claim names both vendors and the robots.",
    ),
    AlertingRule(
        "DeconflictTwoPlaces",
        f"{level('deconflict_advisories_open', where={'kind': 'two_places'})} > 0",
        "0s",
        "page",
        "A robot is reported from two places at once",
        "Robots of {{ $value }} vendors are reported at places that they can't have reached. The newest report counts, "
        "and nobody is warned of them at the other place. GET /advisories?kind=two_places names the robots.",
    ),
    AlertingRule(
        "DeconflictCrowd",
        f"{level('deconflict_advisories_open', where={'kind': 'crowd'})} > 0",
        "0s",
        "page",
        "Many robots report from one place",
        "{{ $value }} times robots report from one place, where they can't all be. Conflicts "
        "among them are not reported. GET /advisories?kind=crowd names the vendor, the place and ten of the robots.",
    ),
)
