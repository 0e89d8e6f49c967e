"""What the site file says of a cluster."""

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field, StringConstraints

from ingest.settings import SecretSource, Section

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]+$")]


class Cluster(Section):
    """Several machines that share the work over a NATS server with JetStream."""

    nats: tuple[str, ...] = Field(min_length=1)
    """Addresses of its servers, nats://HOST:PORT or tls://HOST:PORT."""
    token: SecretSource = ""
    """Where the token is that the servers ask for, `file:PATH` or `env:NAME`; read again with every connection."""
    user: str = ""
    """Name to sign in with instead, if any."""
    password: SecretSource = ""
    """Where its password is, `file:PATH` or `env:NAME`; read again with every connection."""
    ca: str = ""
    """PEM file of the authority that signed the servers' certificates, if it is not one that this machine trusts."""
    certificate: str = ""
    """PEM file of a certificate to show them, and its key, where they ask for one."""
    name: Name = "deconflict"
    """Whoever uses the same name on the same server is one cluster."""
    share_port: bool = False
    """Whether ingests of one machine share the robots' port. Else the second is refused it, as any other service is."""
    tile_m: Annotated[float, Field(ge=10, allow_inf_nan=False)] = 64.0
    """Side of the tiles that floors are shared out in. Small ones overlap more, large ones share less well."""
    fastest_mps: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 2.0
    """Speed of the fastest robot, for how far around its tiles an engine listens. What is quicker is told its floor."""
    hot_per_s: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 2000.0
    """A tile with more statuses a second is split in four."""
    copies: Annotated[int, Field(ge=1, le=5)] = 1
    """How many servers keep each advisory, and the last rows; 3 survives the loss of one."""


def cluster_contradictions(settings: Cluster | None) -> Iterator[str]:
    """What no key shows alone, a sentence each."""
    if settings is None:
        return
    if settings.token and (settings.user or settings.password):
        yield "cluster.token: is told beside a user or password; servers ask for one or the other"
    if bool(settings.user) != bool(settings.password):
        yield f"cluster.{'password' if settings.user else 'user'}: is missing; user and password go together"
    if settings.certificate and not (settings.ca or any(one.startswith("tls://") for one in settings.nats)):
        yield "cluster.certificate: is shown over TLS alone; expected tls:// addresses, or cluster.ca"
