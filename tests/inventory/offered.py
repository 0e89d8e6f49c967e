"""Every item that the product offers its users, one line each, as the code itself says it."""

import argparse
import inspect
import json
import re
import tempfile
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import yaml

from tests.inventory import surface
from tests.inventory.schema_paths import SchemaPaths

READ = {"advisory": "document advisory", "situation": "document situation"}
WRITTEN = {"site": "site", "identity": "message identity", "status": "message status"}
"""By the name of a schema of what users read or write, what its lines begin with."""
VARIABLE = re.compile(r"(?:DECONFLICT|MALLOC|NOTIFY|NUMBA|WATCHDOG)_[A-Z_]+")
EXPLAINED = re.compile(
    r"/\S+|[14]\d{3}|deconflict_\w+|[a-z]+(-[a-z0-9]+)+|[\w/*.-]+\.(db|jsonl?|npz|reserved)|(GET|POST) .+"
)
"""Names in the first column of a table: paths, close codes, metrics, rules, files and requests."""
IMPORT = re.compile(r"from ((?:deconflict|ingest|metrics)[\w.]*) import ([\w, ]+)")


def offered_lines() -> Iterator[str]:
    """All that can be asked without a running service."""
    yield from _commands(surface.parser(), "deconflict")
    for name, begin in (READ | WRITTEN).items():
        document = surface.schema(name)
        yield from (f"{begin} {line}" for line in SchemaPaths(document, written=name in WRITTEN).lines(document))
    yield from _http()
    yield from _channels()
    yield from _metrics()
    yield from _monitoring()
    yield from _language_lines()
    yield from _constant_lines()
    yield from _promises()
    yield from _python()
    yield from _packaging()
    yield from _documented()


def _commands(parser: argparse.ArgumentParser, path: str) -> Iterator[str]:
    """The command itself, its arguments and what each may be, and the commands below it."""
    yield f"command {path}"
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, below in action.choices.items():
                yield from _commands(below, f"{path} {name}")
        elif not isinstance(action, argparse._HelpAction):
            yield from (f"command {path}: {line}" for line in _argument(action))


def _argument(action: argparse.Action) -> Iterator[str]:
    """Its names, what it takes, and what happens without it. Details stand with the longest name."""
    yield from action.option_strings
    name = max(action.option_strings, key=len, default=str(action.metavar or action.dest))
    yield name
    if action.nargs is not None:
        yield f"{name} takes {action.nargs or 'nothing'}"
    if not action.required:
        yield f"{name} may be left out"
    if isinstance(action.default, str | int | float) and action.default is not argparse.SUPPRESS:
        yield f"{name} default {action.default!r}"
    yield from (f"{name} = {choice}" for choice in action.choices or ())


def _http() -> Iterator[str]:
    """Endpoints with their parameters, answers and the fields of both."""
    for route in surface.routes():
        methods = getattr(route, "methods", None) or {"WebSocket"}
        yield from (f"http {method} {route.path}" for method in methods)
    document = surface.schema("openapi")
    sent, answered = SchemaPaths(document, written=True), SchemaPaths(document, written=False)
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            begin = f"http {method.upper()} {path}"
            for given in operation.get("parameters", ()):
                required = [given["name"]] if given.get("required") else []
                schema = {"properties": {given["name"]: given["schema"]}, "required": required}
                yield from (f"{begin} {given['in']} {line}" for line in sent.lines(schema))
            yield from _bodies(f"{begin} body", operation.get("requestBody", {}), sent)
            for code, answer in operation["responses"].items():
                yield f"{begin} answer {code}"
                yield from _bodies(f"{begin} answer {code}", answer, answered)


def _bodies(begin: str, described: surface.Document, paths: SchemaPaths) -> Iterator[str]:
    for kind, content in described.get("content", {}).items():
        yield f"{begin} {kind}"
        if not begin.endswith("422"):
            yield from (f"{begin} {line}" for line in paths.lines(content.get("schema", {})))


def _channels() -> Iterator[str]:
    """The stream, the webhooks and the topics of the broker, with what they carry."""
    document = surface.schema("asyncapi")
    sent, answered = SchemaPaths(document, written=True), SchemaPaths(document, written=False)
    for name, channel in document["channels"].items():
        yield f"channel {name} {channel['address']}"
        query = channel.get("bindings", {}).get("ws", {}).get("query", {})
        yield from (f"channel {name} query {line}" for line in sent.lines(query))
        kinds = query.get("properties", {}).get("kinds", {}).get("description", "")
        yield from (f"channel {name} kind {kind}" for kind in re.findall(r"\w+", kinds.split("), ")[-1]) if kinds)
        for message, described in channel["messages"].items():
            yield f"channel {name} carries {message}"
            yield from (f"channel {name} header {line}" for line in answered.lines(described.get("headers", {})))
    for message, described in document["components"]["messages"].items():
        for value in described.get("payload", {}).get("enum", ()):
            yield f"channel message {message} = {value}"


def _metrics() -> Iterator[str]:
    """The catalogue: whatever the product holds under the name of a metric, with a kind and labels."""
    for name, entry in surface.named_objects():
        if name.startswith("deconflict_") and hasattr(entry, "kind") and hasattr(entry, "labels"):
            yield f"metric {name}: {entry.kind}{''.join(f', {label}' for label in entry.labels)}"


def _monitoring() -> Iterator[str]:
    """Rules for Prometheus and dashboards, as the command writes them."""
    with tempfile.TemporaryDirectory() as folder:
        surface.printed("dashboards", folder)
        for path in sorted(Path(folder).rglob("*.*")):
            yield f"monitoring file {path.relative_to(folder)}"
            text = path.read_text(encoding="utf-8")
            if path.suffix == ".json":
                yield from _dashboard(json.loads(text))
            for group in (yaml.safe_load(text) or {}).get("groups", ()) if "rules" in path.name else ():
                yield from map(_rule, group["rules"])


def _dashboard(page: surface.Document) -> Iterator[str]:
    yield f"dashboard {page['title']}"
    yield from (f"dashboard {page['title']}: {panel['title']}" for panel in page["panels"] if panel.get("title"))
    for variable in page.get("templating", {}).get("list", ()):
        yield f"dashboard {page['title']} variable {variable['name']}"


def _rule(rule: surface.Document) -> str:
    if "record" in rule:
        return f"recording rule {rule['record']}"
    return f"alert {rule['alert']}: {rule['labels'].get('severity')}, for {rule.get('for')}"


def _language_lines() -> Iterator[str]:
    """The keys that each language reads, and the rules that name what deviates."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "fields.json"
        surface.printed("fields", "--json", str(path))
        for table in json.loads(path.read_text(encoding="utf-8")):
            begin = f"message {table['language']} {table['kind']}"
            yield begin
            yield from (f"{begin} key {name}" for name in table["fields"])
            yield from (f"rule {rule}" for rule in _rules(table))


def _rules(value: Any) -> Iterator[str]:
    """Names of rules in a table of what happens: `counted: key-absent (read as empty), null-value (left out)`."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from (*_rules(key), *_rules(inner))
    elif isinstance(value, str):
        for _, names in re.findall(r"(counted|rejected): ([^;]*)", re.sub(r"\([^()]*\)", "", value)):
            yield from re.findall(r"[a-z]+(?:-[a-z0-9]+)+", names)


def _constant_lines() -> Iterator[str]:
    """Environment variables and private close codes of WebSockets, which stand in the source as literals."""
    for value in surface.constants():
        if isinstance(value, str) and VARIABLE.fullmatch(value.rstrip("_")):
            yield f"environment {value}"
        if type(value) is int and 4400 <= value < 4500:
            yield f"close code {value}"


def _promises() -> Iterator[str]:
    section = ""
    for line in surface.document("promises.md").splitlines():
        if line.startswith("## "):
            section = line.removeprefix("## ")
            yield f"promise section {section}"
        if row := re.match(r"\| ([A-Z].+?) \| (.*`test_.+?) \|$", line):
            yield f"promise {row[1]}"
            yield from (f"promise test {name}" for name in re.findall(r"`(test_\w+)`", row[2]))


def _python() -> Iterator[str]:
    """Names that documents and examples import, and that can be imported."""
    pages = [*(surface.ROOT / "docs").glob("*.md"), *(surface.ROOT / "examples").glob("*.py")]
    for module, names in IMPORT.findall("\n".join(page.read_text(encoding="utf-8") for page in pages)):
        for name in map(str.strip, names.split(",")):
            if hasattr(import_module(module), name):
                yield f"python from {module} import {name}"
                yield from _members(getattr(import_module(module), name), name)


def _members(value: Any, name: str) -> Iterator[str]:
    """The parameters of a function, or of the methods that a class itself has."""
    if inspect.isfunction(value):
        yield f"python {name}()"
        yield from (f"python {name}() takes {given}" for given in inspect.signature(value).parameters)
    elif inspect.isclass(value):
        for method, function in vars(value).items():
            if not method.startswith("_") or method == "__init__":
                yield from _members(function, f"{name}.{method}")


def _packaging() -> Iterator[str]:
    project = surface.project()["project"]
    yield f"package {project['name']}, Python {project['requires-python']}"
    yield from (f"package command {name}" for name in project["scripts"])
    for extra, needed in project["optional-dependencies"].items():
        yield f"extra {extra}"
        yield from (f"extra {extra} installs {re.split('[><=;]', name)[0]}" for name in needed)
    for folder in ("deploy", "examples"):
        paths = (
            path for path in (surface.ROOT / folder).rglob("*") if path.is_file() and "__pycache__" not in str(path)
        )
        yield from (f"file {path.relative_to(surface.ROOT)}" for path in paths)
    compose = yaml.safe_load((surface.ROOT / "deploy" / "compose.yaml").read_text(encoding="utf-8"))
    yield from (f"deploy service {name}" for name in compose["services"])


def _documented() -> Iterator[str]:
    """What tables of the documents explain: endpoints, close codes, files, rules and metrics."""
    for page in (surface.ROOT / "docs").glob("*.md"):
        for name in re.findall(r"^\| `([^`|]+)`", page.read_text(encoding="utf-8"), re.M):
            if EXPLAINED.fullmatch(name):
                yield f"documented {name}"
