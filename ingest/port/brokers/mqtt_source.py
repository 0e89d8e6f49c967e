"""The section of the site file for a broker that is heard."""

from typing import Annotated, Literal

from pydantic import Field

from ingest.settings import Seconds, SecretSource, Section

TopicPart = Annotated[str, Field(pattern=r"^[^/+#]+$", max_length=100)]
TopicPrefix = Annotated[str, Field(pattern=r"^[^+#]*[^/+#]$|^$")]


class MqttSource(Section):
    """An MQTT broker whose robots are heard. Nothing is published there."""

    name: Annotated[str, Field(min_length=1, max_length=40)]
    """Short name in metrics and logs."""
    host: str
    """The broker. If empty there is none, and simulated robots in the demo hand their messages over by themselves."""
    port: Annotated[int, Field(gt=0, le=65535)] = 1883
    """Its port; brokers use 8883 for TLS."""
    language: Literal["vda5050", "iso21423"] = "vda5050"
    """The standard of the messages. Its version is read from each message."""
    prefixes: tuple[TopicPrefix, ...] = ()
    """What stands before the manufacturer or the entity type in topics. If empty, what the standard suggests."""
    manufacturers: tuple[TopicPart, ...] = ()
    """Manufacturers whose robots are heard, as topics spell them. If empty, all. Topics of ISO 21423 have none."""
    user: str = ""
    """User name, if the broker needs one."""
    password: SecretSource = ""
    """Source of the password, `file:PATH` or `env:NAME`. It is read again at every connect."""
    tls: bool = False
    """Use TLS."""
    ca: str = ""
    """PEM file of the authority of the broker's certificate. If absent, those that this machine trusts."""
    max_message_bytes: Annotated[int, Field(gt=0)] = 1048576
    """A longer message is refused. Limit messages at the broker too, since they are received before this is known."""
    retry_s: tuple[Seconds, Seconds] = (0.5, 30.0)
    """First and longest wait before connecting again."""
