"""Amounts of a message: speeds, percentages, run times. Values out of range are deviations: clamped or left out.

To add an amount: a key of `AmountsReport`, a line in `_sent`, a line in `read`, and a field of `ingest.batch.Amounts`.
"""

from math import isnan, nan
from typing import Any

from ingest.batch import Amounts
from ingest.languages.massrobotics import path_points
from ingest.languages.massrobotics.json_objects import Report, Velocity
from ingest.languages.model import MAX_SPEED_MPS
from ingest.languages.rules import Findings
from ingest.languages.tolerance.value_reader import LEFT_OUT, is_number, number_of

HOUR_S = 3600.0
LOAD_USED_KEY = "loadPercentageUsed"
"""A key after the text of the standard (5.3.4). Its schema asks for what is still available."""


class AmountsReport(Report):
    """The part of a status that holds amounts."""

    batteryPercentage: float | None = None  # noqa: N815
    remainingRunTime: float | None = None  # noqa: N815
    """Hours."""
    loadPercentageStillAvailable: float | None = None  # noqa: N815


def read(report: AmountsReport, findings: Findings) -> Amounts:
    """The amounts of a status."""
    battery_pct, run_time_left_h, available_pct = _sent(report, findings).values()
    return Amounts(
        nan if battery_pct is None else battery_pct,
        nan if run_time_left_h is None else run_time_left_h * HOUR_S,
        nan if available_pct is None else 100.0 - available_pct,
    )


def document(report: AmountsReport) -> dict[str, float]:
    """The amounts that were sent, under the keys of the standard."""
    return {key: value for key, value in _sent(report, Findings()).items() if value is not None}


def _sent(report: AmountsReport, findings: Findings) -> dict[str, float | None]:
    """The value of each key, in range. None if it was not sent."""
    battery_pct = report.batteryPercentage
    if battery_pct is not None and 0.0 < battery_pct < 1.0:
        findings.note("battery-fraction", "batteryPercentage", battery_pct, "percent")
    available_pct = _load_available(report, findings)
    return {
        "batteryPercentage": _percentage(battery_pct, "battery-out-of-range", "batteryPercentage", findings),
        "remainingRunTime": run_time(report.remainingRunTime, "remainingRunTime", findings),
        "loadPercentageStillAvailable": _percentage(
            available_pct, "load-out-of-range", "loadPercentageStillAvailable", findings
        ),
    }


def motion(velocity: Velocity | None, findings: Findings) -> tuple[float | None, float | None]:
    """Speed along the heading, and the turn made in one second. None if not sent."""
    if velocity is None:
        return None, None
    if velocity.linear is None:
        findings.note("key-absent", "velocity.linear", None, LEFT_OUT)
    turn_rad = path_points.yaw_rad(velocity.angular, findings, "velocity.angular") if velocity.angular else nan
    return speed(velocity.linear, "velocity.linear", findings), None if isnan(turn_rad) else turn_rad


def speed(speed_mps: float | None, key: str, findings: Findings) -> float | None:
    """The speed under a key. None if it is not sent, or none that a robot can have."""
    if speed_mps is None or abs(speed_mps) <= MAX_SPEED_MPS:
        return speed_mps
    findings.note("speed-absurd", key, speed_mps, LEFT_OUT)
    return None


def speed_limit(speed_mps: float | None, findings: Findings) -> float | None:
    """The greatest speed of a robot. None if it is not sent or not above zero."""
    limit_mps = speed(speed_mps, "maxSpeed", findings)
    if limit_mps is None or limit_mps > 0:
        return limit_mps
    findings.note("speed-limit-not-positive", "maxSpeed", speed_mps, LEFT_OUT)
    return None


def _load_available(report: AmountsReport, findings: Findings) -> float | None:
    """How much more the robot could carry, in percent. Derived from the load used if only that is sent."""
    available_pct = report.loadPercentageStillAvailable
    extra = report.__pydantic_extra__
    if extra and LOAD_USED_KEY in extra:
        findings.note("load-used-key", LOAD_USED_KEY, extra[LOAD_USED_KEY], "loadPercentageStillAvailable")
        used_pct = _number(extra[LOAD_USED_KEY], findings)
        if available_pct is None and used_pct is not None:
            available_pct = 100.0 - used_pct
    return available_pct


def _number(value: Any, findings: Findings) -> float | None:
    """The number that a value is or spells. None if it is none."""
    spelt = number_of(value) if isinstance(value, str) else None
    if spelt is not None:
        findings.note("number-as-text", LOAD_USED_KEY, value, f"{spelt:g}")
    return float(value) if is_number(value) else spelt


def _percentage(value_pct: float | None, rule: str, key: str, findings: Findings) -> float | None:
    """The value under a key clamped to 0 to 100. A value outside deviates from `rule`."""
    if value_pct is None or 0.0 <= value_pct <= 100.0:
        return value_pct
    clamped_pct = min(max(value_pct, 0.0), 100.0)
    findings.note(rule, key, value_pct, f"{clamped_pct:g}")
    return clamped_pct


def run_time(hours: float | None, key: str, findings: Findings) -> float | None:
    """The hours under a key, not negative."""
    if hours is None or hours >= 0.0:
        return hours
    findings.note("run-time-negative", key, hours, "0")
    return 0.0
