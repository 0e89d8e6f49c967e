"""Sections of the site file about outlets."""

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Annotated

from pydantic import Field

from ingest.settings import Seconds, SecretSource, Section

Backoff = tuple[Seconds, Seconds]


class Webhook(Section):
    """One address that every revision of every advisory is posted to."""

    name: str
    """Labels metrics and the place in the store; a new name begins with the next revision."""
    url: Annotated[str, Field(pattern=r"^https?://")]
    """Receives `POST` with one revision as JSON; any answer of 200 to 299 takes it."""
    secret: SecretSource
    """Where the secret is that signs each request, `file:PATH` or `env:NAME`."""
    timeout_s: Seconds = 10.0
    """A request that is not answered for this long has failed."""
    retry_s: Backoff = (1.0, 60.0)
    """First and longest wait before a failed request is tried again."""


class Mqtt(Section):
    """An MQTT broker that holds the open advisories as retained messages."""

    host: str
    """The broker."""
    port: Annotated[int, Field(gt=0, le=65535)] = 1883
    """Its port; brokers use 8883 for TLS."""
    topic: Annotated[str, Field(pattern=r"^[^#+$]+$")] = "deconflict"
    """Advisories are at `TOPIC/advisories/ID`, and whether the service is there at `TOPIC/service`."""
    user: str = ""
    """Name to sign in with, if any."""
    password: SecretSource = ""
    """Where the password is, `file:PATH` or `env:NAME`."""
    tls: bool = False
    """Speak TLS, and trust the certificates that this machine trusts."""
    retry_s: Backoff = (1.0, 60.0)
    """First and longest wait before the broker is sought again."""


def outlet_problems(webhooks: Iterable[Webhook], mqtt: Mqtt | None) -> Iterator[str]:
    """What no key shows alone, a sentence each."""
    hooks = list(webhooks)
    names = Counter(one.name for one in hooks)
    for row, one in enumerate(hooks):
        if names[one.name] > 1 or one.name == "mqtt":
            yield f"webhooks[{row}].name: {one.name!r} is taken; give each outlet a name of its own"
        if not one.secret:
            yield f"webhooks[{row}].secret: is empty; expected env:NAME or file:PATH"
    waits = [(f"webhooks[{row}]", one.retry_s) for row, one in enumerate(hooks)]
    for key, (first_s, longest_s) in [*waits, *([("mqtt", mqtt.retry_s)] if mqtt else [])]:
        if first_s > longest_s:
            yield f"{key}.retry_s: found {[first_s, longest_s]}; expected the first wait not above the longest"
