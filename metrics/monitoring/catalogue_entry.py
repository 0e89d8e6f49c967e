"""One entry of the catalogue of metrics."""

from dataclasses import dataclass
from typing import Literal

from ingest.measures.measures import Labels

Kind = Literal["counter", "gauge", "histogram"]


@dataclass(frozen=True, slots=True)
class CatalogueEntry:
    """One metric of the catalogue."""

    kind: Kind
    labels: Labels
    """Names of the labels."""
    help: str
    """What it measures, for people. Prometheus and the dashboards show it."""


def counter(meaning: str, *labels: str) -> CatalogueEntry:
    return CatalogueEntry("counter", labels, meaning)


def gauge(meaning: str, *labels: str) -> CatalogueEntry:
    return CatalogueEntry("gauge", labels, meaning)


def histogram(meaning: str, *labels: str) -> CatalogueEntry:
    return CatalogueEntry("histogram", labels, meaning)
