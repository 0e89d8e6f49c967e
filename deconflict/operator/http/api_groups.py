"""Adds to the OpenAPI description what FastAPI does not know: credentials, groups of routes, and their refusals."""

from typing import Any

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


def described(document: dict[str, Any]) -> dict[str, Any]:
    """The description with tags, security schemes and refusals."""
    tag_of = {part: tag for tag, (_, parts) in GROUPS.items() for part in parts}
    for path, item in document["paths"].items():
        for operation in item.values():
            operation["tags"] = [tag_of[path.split("/")[1]]]
            if path not in OPEN_TO_ALL:
                operation["responses"] |= {code: {"description": text} for code, text in REFUSALS.items()}
                operation["security"] = [{"token": []}, {}]
    document["tags"] = [{"name": tag, "description": text} for tag, (text, _) in GROUPS.items()]
    schemes = {"token": {"type": "http", "scheme": "bearer", "description": "token of a person of the site file"}}
    document["components"]["securitySchemes"] = schemes
    return document
