"""PromQL built from the catalogue, so that no dashboard or rule uses a metric or label that does not exist."""

from collections.abc import Iterable, Mapping

from ingest.measures.measures import LATENCY_BOUNDS_S
from metrics.monitoring.catalogue import CATALOGUE
from metrics.monitoring.catalogue_entry import CatalogueEntry

Where = Mapping[str, str]
"""Required value by label."""


class UnknownSeriesError(ValueError):
    """A query uses a metric or label that the catalogue does not have."""


def level(name: str, by: Iterable[str] = (), *, where: Where | None = None, over: str = "sum") -> str:
    """A gauge, aggregated by `over`: sum, max, min or avg."""
    return f"{over}{_by(by)} ({_series(name, 'gauge', by, where)})"


def rate(name: str, window: str, by: Iterable[str] = (), *, where: Where | None = None) -> str:
    """The increase of a counter per second."""
    return f"sum{_by(by)} (rate({_series(name, 'counter', by, where)}[{window}]))"


def increase(name: str, window: str, by: Iterable[str] = (), *, where: Where | None = None) -> str:
    """The increase of a counter within the window."""
    return f"sum{_by(by)} (increase({_series(name, 'counter', by, where)}[{window}]))"


def increase_before(name: str, window: str, offset: str, by: Iterable[str] = ()) -> str:
    """The increase of a counter within the window that ended `offset` ago."""
    return f"sum{_by(by)} (increase({_series(name, 'counter', by, None)}[{window}] offset {offset}))"


def quantile(share: float, name: str, window: str, by: Iterable[str] = ()) -> str:
    """The `share` quantile of a histogram."""
    buckets = _series(name, "histogram", by, None, "_bucket")
    return f"histogram_quantile({share}, sum{_by([*by, 'le'])} (rate({buckets}[{window}])))"


def share_within(bound_s: float, name: str, window: str, by: Iterable[str] = ()) -> str:
    """Share of a histogram's observations that are at most `bound_s`, which must be one of its bounds."""
    if bound_s not in LATENCY_BOUNDS_S:
        raise UnknownSeriesError(f"{name} has no bound at {bound_s}")
    within = _series(name, "histogram", by, None, "_bucket") + f'{{le="{bound_s}"}}'
    every = _series(name, "histogram", by, None, "_count")
    return f"sum{_by(by)} (rate({within}[{window}])) / sum{_by(by)} (rate({every}[{window}]))"


def time_share(name: str, window: str) -> str:
    """Share of the time that the durations of a histogram add up to."""
    return f"sum (rate({_series(name, 'histogram', (), None, '_sum')}[{window}]))"


def or_zero_by_vendor(query: str) -> str:
    """The query, with 0 for each vendor that has robots but no result."""
    return f"{query} or 0 * {level('deconflict_robots', ['vendor'])}"


def or_zero(query: str) -> str:
    """The query, with 0 if it has no result."""
    return f"{query} or vector(0)"


def _series(name: str, kind: str, by: Iterable[str], where: Where | None, suffix: str = "") -> str:
    entry = _entry(name, kind)
    where = where or {}
    if unknown := {*by, *where} - set(entry.labels):
        raise UnknownSeriesError(f"{name} has no label {', '.join(sorted(unknown))}; it has {', '.join(entry.labels)}")
    matching = ",".join(f'{label}="{value}"' for label, value in where.items())
    return f"{name}{suffix}{{{matching}}}" if matching else f"{name}{suffix}"


def _entry(name: str, kind: str) -> CatalogueEntry:
    entry = CATALOGUE.get(name)
    if entry is None:
        raise UnknownSeriesError(f"the catalogue has no metric {name}")
    if entry.kind != kind:
        raise UnknownSeriesError(f"{name} is a {entry.kind}, not a {kind}")
    return entry


def _by(labels: Iterable[str]) -> str:
    named = ", ".join(labels)
    return f" by ({named})" if named else ""
