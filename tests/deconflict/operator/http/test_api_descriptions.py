import json
import subprocess
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator
from openapi_spec_validator import validate

from deconflict.operator.http.api_descriptions import asyncapi, openapi
from deconflict_client.advisory import Severity
from tests.helpers.made_advisories import deadlock, made, situation
from tests.helpers.node_libraries import ENVIRONMENT, needs_library


def references(part: Any) -> set[str]:
    """Every `$ref` below a part of a document."""
    if isinstance(part, dict):
        own = {part["$ref"]} if isinstance(part.get("$ref"), str) else set()
        return own.union(*(references(each) for each in part.values()))
    return set().union(*(references(each) for each in part)) if isinstance(part, list) else set()


def found(document: dict[str, Any], reference: str) -> Any:
    at: Any = document
    for part in reference.removeprefix("#/").split("/"):
        at = at[part]
    return at


def test_the_openapi_document_is_valid_and_has_every_route() -> None:
    document = openapi()
    validate(document)
    assert {"/situations", "/advisories", "/advisories/{advisory_id}/acknowledgement", "/metrics", "/vendors"} <= set(
        document["paths"]
    )


def test_every_operation_has_a_group_a_name_for_clients_and_its_refusals() -> None:
    document = openapi()
    operations = [(path, each) for path, item in document["paths"].items() for each in item.values()]
    names = [each["operationId"] for _, each in operations]
    assert len(set(names)) == len(names)
    assert all(name.isidentifier() and len(name) < 30 for name in names)
    tags = {tag["name"] for tag in document["tags"]}
    assert all(set(each["tags"]) <= tags and each["description"] for _, each in operations)
    closed = [each for path, each in operations if path != "/healthz"]
    assert all({"401", "403"} <= each["responses"].keys() and {"token": []} in each["security"] for each in closed)
    assert document["components"]["securitySchemes"]["token"]["scheme"] == "bearer"


def test_a_discriminator_of_the_asyncapi_document_is_the_name_of_a_property() -> None:
    schemas = asyncapi()["components"]["schemas"]
    assert [schema["discriminator"] for schema in schemas.values() if "discriminator" in schema] == ["kind"]


@needs_library("@asyncapi/parser")
def test_the_asyncapi_document_is_valid_for_the_official_parser() -> None:
    program, document = Path(__file__).with_name("asyncapi_parser.js"), json.dumps(asyncapi())
    read = subprocess.run(
        ["node", program], input=document, env=ENVIRONMENT, capture_output=True, text=True, check=False
    )
    assert (read.returncode, read.stdout, read.stderr) == (0, "", "")


def test_every_reference_of_the_asyncapi_document_resolves() -> None:
    document = asyncapi()
    lines = references(document)
    assert len(lines) > 10
    assert all(reference.startswith("#/") and found(document, reference) for reference in lines)


def test_each_channel_has_an_operation_servers_and_messages() -> None:
    document = asyncapi()
    operated = {value["channel"]["$ref"] for value in document["operations"].values()}
    assert operated == {f"#/channels/{name}" for name in document["channels"]}
    for channel in document["channels"].values():
        assert channel["servers"]
        assert channel["messages"]
        assert channel["address"].count("{") == len(channel.get("parameters", {}))


def test_a_situation_is_a_message_of_the_stream_and_of_the_outlets() -> None:
    document = asyncapi()
    payload = document["components"]["messages"]["situation"]["payload"]
    result = Draft202012Validator({**payload, "components": document["components"]})
    assert list(result.iter_errors(situation(1).model_dump(mode="json"))) == []
    assert list(result.iter_errors(made(1).model_dump(mode="json")))
    channels = document["channels"]
    assert all("situation" in channels[name]["messages"] for name in ("stream", "webhook", "retained_situations"))
    assert channels["retained_situations"]["address"] == "deconflict/situations/{id}"


def test_the_message_of_the_asyncapi_document_is_an_advisory_of_any_kind() -> None:
    document = asyncapi()
    payload = document["components"]["messages"]["revision"]["payload"]
    result = Draft202012Validator({**payload, "components": document["components"]})
    for advisory in (made(1, severity=Severity.CRITICAL), deadlock("a", "b", "c")):
        assert list(result.iter_errors(advisory.model_dump(mode="json"))) == []
    assert list(result.iter_errors({**made(1).model_dump(mode="json"), "kind": "rumour"}))
