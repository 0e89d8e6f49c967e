"""JSON Schemas of what the service publishes and reads."""

from collections.abc import Callable
from typing import Any

from deconflict.advisory import ADVISORY
from deconflict.site import Site
from ingest.reports import IdentityReport, StatusReport

SCHEMAS: dict[str, Callable[[], dict[str, Any]]] = {
    "advisory": lambda: ADVISORY.json_schema(mode="serialization"),
    "identity": IdentityReport.model_json_schema,
    "site": Site.model_json_schema,
    "status": StatusReport.model_json_schema,
}
