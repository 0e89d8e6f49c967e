"""Adds to the OpenAPI description what FastAPI does not know: credentials, groups of routes, and their refusals."""

from typing import Any

from deconflict_client.answers.api_models import RefusedRequest

GROUPS = {
    "situations": ("What people should look at", ("situations", "shift")),
    "advisories": ("What programs follow", ("advisories", "advice", "heat")),
    "floor": (
        "Robots and vendors, as they report, and the time that they lose",
        ("losses", "suggestions", "robots", "vendors", "quarantine", "presence"),
    ),
    "map": ("What a map shows", ("site", "plans", "recorded", "past")),
    "operation": ("State of the service", ("healthz", "metrics", "blackboxes", "schema")),
}
"""By tag, its description and the first parts of its paths."""
REFUSALS = {
    "401": "No credentials, or wrong ones, where the site file names people",
    "403": "Their role may not do this",
}
OPEN_TO_ALL = ("/healthz",)
REFUSED = RefusedRequest.__name__
VALIDATION_MODELS = ("HTTPValidationError", "ValidationError")
"""FastAPI's own, which are never sent."""


def described(document: dict[str, Any]) -> dict[str, Any]:
    """The description with tags, security schemes and refusals."""
    tag_of = {part: tag for tag, (_, parts) in GROUPS.items() for part in parts}
    for path, item in document["paths"].items():
        for operation in item.values():
            operation["tags"] = [tag_of[path.split("/")[1]]]
            if path not in OPEN_TO_ALL:
                operation["responses"] |= {code: {"description": text} for code, text in REFUSALS.items()}
                operation["security"] = [{"token": []}, {}]
            for code, answer in operation["responses"].items():
                if code >= "400" and _has_no_form(answer):
                    answer["content"] = {"application/json": {"schema": {"$ref": f"#/components/schemas/{REFUSED}"}}}
    schemas = document["components"]["schemas"]
    for name in VALIDATION_MODELS:
        schemas.pop(name, None)
    schemas[REFUSED] = RefusedRequest.model_json_schema()
    document["tags"] = [{"name": tag, "description": text} for tag, (text, _) in GROUPS.items()]
    schemes = {"token": {"type": "http", "scheme": "bearer", "description": "token of a person of the site file"}}
    document["components"]["securitySchemes"] = schemes
    return document


def _has_no_form(answer: dict[str, Any]) -> bool:
    """Whether the description does not say what a refusal consists of, or says what FastAPI would send."""
    schema = answer.get("content", {}).get("application/json", {}).get("schema", {})
    return schema.get("$ref", "").rpartition("/")[2] in ("", *VALIDATION_MODELS)
