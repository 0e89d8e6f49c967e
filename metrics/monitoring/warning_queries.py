"""The queries of the quality of warnings, in the words of `metrics/scoring/warnings/warning_quality.py`."""

from collections.abc import Iterable

from metrics.monitoring.promql import increase, quantile

OUTCOMES = ("came_true", "in_vain", "not_judged")
_WARNINGS, _EVENTS = "deconflict_warnings_judged_total", "deconflict_events_judged_total"
_VENDOR_WARNINGS, _VENDOR_EVENTS = "deconflict_vendor_warnings_judged_total", "deconflict_vendor_events_judged_total"


def warnings(outcome: str, window: str, by: Iterable[str] = ()) -> str:
    """How many warnings came true, were in vain or are not judged."""
    return increase(_VENDOR_WARNINGS if by else _WARNINGS, window, by, where={"outcome": outcome})


def judged(window: str, by: Iterable[str] = ()) -> str:
    """How many warnings came true or were in vain."""
    by = list(by)
    return f"({_or_none('came_true', window, by)} + {_or_none('in_vain', window, by)})"


def share_came_true(window: str, by: Iterable[str] = ()) -> str:
    """The share that came true of the warnings that are judged."""
    by = list(by)
    return f"{_or_none('came_true', window, by)} / {judged(window, by)}"


def share_in_vain(window: str, by: Iterable[str] = ()) -> str:
    """The share in vain of the warnings that are judged."""
    by = list(by)
    return f"{_or_none('in_vain', window, by)} / {judged(window, by)}"


def share_warned_of(window: str, by: Iterable[str] = ()) -> str:
    """The share of the events that were warned of."""
    name, by = _VENDOR_EVENTS if by else _EVENTS, list(by)
    every = increase(name, window, by)
    return f"({increase(name, window, by, where={'warned_of': 'yes'})} or 0 * {every}) / {every}"


def ahead_by(window: str) -> str:
    """From raising the warning to the event that was warned of, median."""
    return quantile(0.5, "deconflict_warned_ahead_seconds", window)


def _or_none(outcome: str, window: str, by: list[str]) -> str:
    """So many warnings, or 0 where all had other outcomes."""
    every = increase(_VENDOR_WARNINGS if by else _WARNINGS, window, by)
    return f"({warnings(outcome, window, by)} or 0 * {every})"
