"""Descriptions of the whole interface for tools: OpenAPI for requests, AsyncAPI for messages."""

from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any, cast

from deconflict.operator.http.api import DESCRIPTION, create_app
from deconflict.operator.http.api_sources import Sources
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.store import Store
from deconflict.settings.outlet_settings import Mqtt
from deconflict.settings.site import Operator, Site
from deconflict_client.advisory import ADVISORY, EVERY_KIND
from deconflict_client.situations import REVISION
from ingest.measures.measures import Measures

Document = dict[str, Any]
MESSAGES = {"revision": "AnyAdvisory", "situation": "Situation", "advice": "RobotAdvice"}
"""By message, its schema."""
SIGNATURE = ("webhook-id", "webhook-timestamp", "webhook-signature")
_NO_SOURCES = cast(Sources, SimpleNamespace(follow=None, live_status=None))
"""A description of the interface calls none of them."""


def openapi() -> Document:
    """OpenAPI 3.1, as the service returns it at `/openapi.json`."""
    with TemporaryDirectory() as folder:
        store = Store(Path(folder))
        try:
            publisher = Publisher(store, Measures())
            return create_app(publisher, store, _NO_SOURCES, lambda _: (b"", ""), Site()).openapi()
        finally:
            store.close()


def asyncapi() -> Document:
    """AsyncAPI 3.0: the stream, the webhooks and the broker's topics. All carry the same messages."""
    template = "#/components/schemas/{model}"
    advisory = ADVISORY.json_schema(mode="serialization", ref_template=template)
    schemas = REVISION.json_schema(mode="serialization", ref_template=template)["$defs"]
    schemas["AnyAdvisory"] = {key: value for key, value in advisory.items() if key != "$defs"}
    for schema in schemas.values():  # AsyncAPI wants the name of the property alone
        if "discriminator" in schema:
            schema["discriminator"] = schema["discriminator"]["propertyName"]
    channels = {
        "stream": _stream(),
        "webhook": _webhook(),
        "retained": _retained("advisories", "revision"),
        "retained_situations": _retained("situations", "situation"),
        "retained_advice": _retained("advice", "advice"),
        "service": _service(),
    }
    return {
        "asyncapi": "3.0.0",
        "info": {"title": "amr-deconflict", "version": version("amr-deconflict"), "description": DESCRIPTION},
        "defaultContentType": "application/json",
        "servers": {
            "operator": {"host": f"127.0.0.1:{Operator().port}", "protocol": "ws"},
            "broker": {"host": "broker.example:1883", "protocol": "mqtt", "protocolVersion": "3.1.1"},
            "site": {"host": "mes.example", "protocol": "https"},
        },
        "channels": channels,
        "operations": {
            f"send_{channel}": {"action": "send", "channel": {"$ref": f"#/channels/{channel}"}} for channel in channels
        },
        "components": {
            "messages": {
                "revision": {"title": "One revision of an advisory", **_content("revision")},
                "situation": {"title": "One revision of a situation", **_content("situation")},
                "advice": {"title": "One revision of advice", **_content("advice")},
                "presence": {"contentType": "text/plain", "payload": {"type": "string", "enum": ["online", "offline"]}},
            },
            "schemas": schemas,
        },
    }


def _content(message: str) -> Document:
    return {"contentType": "application/json", "payload": {"$ref": f"#/components/schemas/{MESSAGES[message]}"}}


def _stream() -> Document:
    after = "the last `seq` that you have seen; without it the stream begins with the next revision"
    kinds = f"separated by commas: advisory (every kind of advisory, the default), {', '.join(sorted(EVERY_KIND))}"
    query = {
        "after": {"type": "integer", "minimum": 0, "description": after},
        "kinds": {"type": "string", "description": kinds},
    }
    return {
        "address": "/advisories/stream",
        "servers": [{"$ref": "#/servers/operator"}],
        "description": "Every revision of `kinds` in order. With `after`, first the revisions that were missed.",
        "bindings": {"ws": {"method": "GET", "query": {"type": "object", "properties": query}}},
        "messages": {message: {"$ref": f"#/components/messages/{message}"} for message in MESSAGES},
    }


def _webhook() -> Document:
    headers = {"type": "object", "required": SIGNATURE, "properties": {name: {"type": "string"} for name in SIGNATURE}}
    return {
        "address": "/",
        "servers": [{"$ref": "#/servers/site"}],
        "description": "POST to each address of the site file, signed by Standard Webhooks 1.0.",
        "messages": {
            message: {**_content(message), "headers": headers, "bindings": {"http": {}}} for message in MESSAGES
        },
    }


def _retained(topic: str, message: str) -> Document:
    return {
        "address": f"{Mqtt.model_fields['topic'].default}/{topic}/{{id}}",
        "servers": [{"$ref": "#/servers/broker"}],
        "parameters": {"id": {"description": "in each of its revisions"}},
        "description": "Retained while it is open. Emptied after the revision that clears it.",
        "messages": {message: {"$ref": f"#/components/messages/{message}"}},
    }


def _service() -> Document:
    return {
        "address": f"{Mqtt.model_fields['topic'].default}/service",
        "servers": [{"$ref": "#/servers/broker"}],
        "description": "Retained: whether the service is connected.",
        "messages": {"presence": {"$ref": "#/components/messages/presence"}},
    }
