"""JSON Schemas of the documents that the service publishes and reads."""

from collections.abc import Callable
from typing import Any

from deconflict.settings.site import Site
from deconflict_client.advisory import ADVISORY
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.situations import Situation
from ingest.languages.massrobotics.report_models import IdentityReport, StatusReport

SCHEMAS: dict[str, Callable[[], dict[str, Any]]] = {
    "advice": lambda: RobotAdvice.model_json_schema(mode="serialization"),
    "advisory": lambda: ADVISORY.json_schema(mode="serialization"),
    "identity": IdentityReport.model_json_schema,
    "situation": lambda: Situation.model_json_schema(mode="serialization"),
    "site": Site.model_json_schema,
    "status": StatusReport.model_json_schema,
}
