"""Sections of the site file for outlets: webhooks and an MQTT broker."""

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Annotated

from pydantic import Field

from deconflict_client.advisory import KindChoice
from ingest.settings import Seconds, SecretSource, Section

Backoff = tuple[Seconds, Seconds]
Kinds = Annotated[tuple[KindChoice, ...], Field(min_length=1)]


class Webhook(Section):
    """An address that receives every revision of every situation, or of other kinds."""

    name: str
    """Label in metrics, and name of the position in the store. A new name begins with the next revision."""
    url: Annotated[str, Field(pattern=r"^https?://")]
    """Receives a `POST` with one revision as JSON. An answer of 200 to 299 accepts it."""
    secret: SecretSource
    """Source of the secret that signs each request, `file:PATH` or `env:NAME`."""
    kinds: Kinds = ("situation",)
    """What it receives: `situation`, `advice`, `advisory` for every kind of advisory, or some kinds of advisory."""
    timeout_s: Seconds = 10.0
    """A request without an answer for this long has failed."""
    retry_s: Backoff = (1.0, 60.0)
    """First and longest wait before a failed request is sent again."""


class Mqtt(Section):
    """An MQTT broker that has the open situations, or other kinds, as retained messages."""

    host: str
    """The broker."""
    port: Annotated[int, Field(gt=0, le=65535)] = 1883
    """Its port; brokers use 8883 for TLS."""
    topic: Annotated[str, Field(pattern=r"^[^#+$]+$")] = "deconflict"
    """Situations are at `TOPIC/situations/ID`, advisories at `TOPIC/advisories/ID`, advice at `TOPIC/advice/ID`, the
    service's state at `TOPIC/service`."""
    kinds: Kinds = ("situation",)
    """What it receives: `situation`, `advice`, `advisory` for every kind of advisory, or some kinds of advisory."""
    user: str = ""
    """User name, if the broker needs one."""
    password: SecretSource = ""
    """Source of the password, `file:PATH` or `env:NAME`."""
    tls: bool = False
    """Use TLS."""
    ca: str = ""
    """PEM file of the authority of the broker's certificate. If absent, those that this machine trusts."""
    retry_s: Backoff = (1.0, 60.0)
    """First and longest wait before connecting again."""


def outlet_problems(webhooks: Iterable[Webhook], mqtt: Mqtt | None) -> Iterator[str]:
    """A sentence for each contradiction between keys."""
    hooks = list(webhooks)
    names = Counter(webhook.name for webhook in hooks)
    for row, webhook in enumerate(hooks):
        if names[webhook.name] > 1 or webhook.name == "mqtt":
            yield f"webhooks[{row}].name: {webhook.name!r} is taken; give each outlet a name of its own"
        if not webhook.secret:
            yield f"webhooks[{row}].secret: is empty; expected env:NAME or file:PATH"
    if mqtt and mqtt.ca and not mqtt.tls:
        yield "mqtt.ca: is used over TLS alone; set tls = true"
    waits = [(f"webhooks[{row}]", webhook.retry_s) for row, webhook in enumerate(hooks)]
    for key, retry_s in [*waits, *([("mqtt", mqtt.retry_s)] if mqtt else [])]:
        yield from retry_problems(key, retry_s)


def retry_problems(key: str, retry_s: Backoff) -> Iterator[str]:
    """A sentence if the first wait is longer than the longest."""
    first_s, longest_s = retry_s
    if first_s > longest_s:
        yield f"{key}.retry_s: found {[first_s, longest_s]}; expected the first wait not above the longest"
