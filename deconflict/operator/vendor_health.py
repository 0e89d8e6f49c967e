"""The state of each vendor, computed from the measures of the roles."""

from collections import Counter
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from typing import Any

from deconflict.foresight.forecast_errors.forecast_grades import in_words
from deconflict_client.advisory.cleared_code import ClearedCode
from deconflict_client.advisory.robot_advice import ASKED, ENDED, REFUSED, REFUSED_S, YIELDED
from deconflict_client.answers.vendor_models import Flag, UncomparedRobot, VendorAdvice, VendorHealth, VendorOddValue
from deconflict_client.participant_kinds import ParticipantKind
from ingest.measures import clock_changes
from ingest.measures.measures import Labels, joined_values

DIGITS = 3
"""Values are rounded to millimetres and milliseconds."""

Values = Mapping[str, Mapping[Labels, float]]


def vendor_health(documents: Iterable[dict[str, Any]], senders: Iterable[dict[str, Any]] = ()) -> list[VendorHealth]:
    """The vendors by name. `documents` are the measures of the roles that answer, `senders` what vendors should mend,
    as each receiver gives it (`fleet_report.senders`).
    """
    values = {
        name: {labels: round(value, DIGITS) for labels, value in series.items()}
        for name, series in joined_values(documents).items()
    }
    with_vendors = ("deconflict_robots", "deconflict_messages_total")
    names = {labels[0] for name in with_vendors for labels in values.get(name, ())}
    to_mend = _to_mend(senders)
    return [
        _health_of(name, _series_of(values, name)).model_copy(
            update={"advice": _advice_of(name, values), **to_mend.get(name, {})}
        )
        for name in sorted(names)
    ]


def _advice_of(vendor: str, values: Values) -> VendorAdvice:
    """What was asked of a vendor, and who yielded to whom."""
    ended = {
        code: sum(count for labels, count in values.get(ENDED, {}).items() if (labels[0], labels[2]) == (vendor, code))
        for code in (ClearedCode.DONE, ClearedCode.DECLINED, ClearedCode.WITHDRAWN, ClearedCode.LAPSED)
    }
    yielded = values.get(YIELDED, {}).items()
    refused, refused_s = values.get(REFUSED, {}), values.get(REFUSED_S, {})
    return VendorAdvice(
        asked=int(sum(count for labels, count in values.get(ASKED, {}).items() if labels[0] == vendor)),
        done=int(ended[ClearedCode.DONE]),
        declined=int(ended[ClearedCode.DECLINED]),
        not_begun=int(ended[ClearedCode.WITHDRAWN] + ended[ClearedCode.LAPSED]),
        refusals=int(refused.get((vendor, "unwilling"), 0)),
        refused_s=refused_s.get((vendor, "unwilling"), 0.0),
        unable=int(refused.get((vendor, "unable"), 0)),
        unable_s=refused_s.get((vendor, "unable"), 0.0),
        yielded_s=sum(seconds for labels, seconds in yielded if labels[0] == vendor),
        let_through_s=sum(seconds for labels, seconds in yielded if labels[1] == vendor),
    )


def _to_mend(senders: Iterable[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """What each vendor sends otherwise, and who its devices are. Several receivers may have robots of one."""
    odd_values: dict[str, dict[tuple[str, str], VendorOddValue]] = {}
    not_compared: dict[str, list[UncomparedRobot]] = {}
    participants: dict[str, Counter[ParticipantKind]] = {}
    for sender in senders:
        rows = odd_values.setdefault(sender["vendor"], {})
        for value in map(VendorOddValue.model_validate, sender["odd_values"]):
            if known := rows.get((value.rule, value.path)):
                value.robots, value.count = value.robots + known.robots, value.count + known.count
            rows[value.rule, value.path] = value
        participants.setdefault(sender["vendor"], Counter()).update(sender.get("participants", {}))
        robots = not_compared.setdefault(sender["vendor"], [])
        robots += map(UncomparedRobot.model_validate, sender["not_compared"])
    return {
        vendor: {
            "odd_values": [*rows.values()],
            "not_compared": not_compared[vendor],
            "participants": dict(participants[vendor]),
        }
        for vendor, rows in odd_values.items()
    }


def _series_of(values: Values, vendor: str) -> Values:
    """The series of one vendor, without its name."""
    return {
        name: {labels[1:]: value for labels, value in series.items() if labels[:1] == (vendor,)}
        for name, series in values.items()
    }


def _health_of(name: str, values: Values) -> VendorHealth:
    def counts(measure: str) -> dict[str, int]:
        return {labels[0]: int(count) for labels, count in sorted(values.get(measure, {}).items())}

    def level(measure: str) -> float | None:
        return values.get(measure, {}).get(())

    robots, messages = counts("deconflict_robots"), counts("deconflict_messages_total")
    deviations = counts("deconflict_deviations_total")
    grade = max(counts("deconflict_forecast_grade"), default=None)
    return VendorHealth.model_validate(
        {
            "name": name,
            "robots": sum(robots.values()),
            "languages": sorted(counts("deconflict_robots_by_language")),
            "silent": robots.get("silent", 0),
            "distrusted": level("deconflict_robots_distrusted") or 0,
            "messages": sum(messages.values()),
            "messages_per_s": level("deconflict_messages_per_second"),
            "rejected": messages.get("rejected", 0),
            "rejections_by_rule": counts("deconflict_rejections_total"),
            "deviations": sum(deviations.values()),
            "deviations_by_rule": deviations,
            "clock_s": level("deconflict_clock_offset_seconds"),
            "delay_s": level("deconflict_clock_delay_seconds"),
            "forecast_age_s": level("deconflict_forecast_age_seconds"),
            "forecast_error": _forecast_error(values),
            "coverage": [
                {"share": share, "covered": covered}
                for (share,), covered in sorted(values.get("deconflict_forecast_band_coverage_ratio", {}).items())
            ],
            "arrivals": _arrivals(values),
            "grade": grade,
            "grade_words": in_words(grade),
            "flags": list(_flags(values)),
        }
    )


def _forecast_error(values: Values) -> list[dict[str, float]]:
    rows: dict[int, dict[str, float]] = {}
    for (horizon_s, share), metres in values.get("deconflict_forecast_error_metres", {}).items():
        rows.setdefault(int(horizon_s), {})[f"p{float(share) * 100:.0f}_m"] = metres
    return [{"horizon_s": horizon_s, **sizes} for horizon_s, sizes in sorted(rows.items())]


def _arrivals(values: Values) -> list[dict[str, float]]:
    rows: dict[float, dict[str, float]] = {}
    for (ahead_s, share), seconds in values.get("deconflict_arrival_error_seconds", {}).items():
        rows.setdefault(float(ahead_s), {})[f"p{float(share) * 100:.0f}_s"] = seconds
    for (ahead_s,), late in values.get("deconflict_arrivals_late_ratio", {}).items():
        rows.setdefault(float(ahead_s), {})["late"] = late
    return [{"ahead_up_to_s": ahead_s, **sizes} for ahead_s, sizes in sorted(rows.items())]


def _flags(values: Values) -> Iterable[Flag]:
    for (what,), since_s in sorted(values.get(clock_changes.SINCE, {}).items()):
        by = values.get(clock_changes.AMOUNTS[what], {}).get((), 0.0)
        words = {
            "forecast": f"forecasts {by:.1f} m further off than usual",
            "datum": f"positions {by:.1f} m off",
            "clock": f"clocks {abs(by):.1f} s {'slower' if by > 0 else 'faster'} than usual",
        }
        yield Flag.model_validate(
            {"what": what, "since": datetime.fromtimestamp(since_s, UTC), "by": by, "words": words[what]}
        )
