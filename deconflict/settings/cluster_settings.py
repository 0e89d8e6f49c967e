"""The section of the site file for a cluster."""

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field, StringConstraints

from ingest.settings import SecretSource, Section

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]+$")]

ExpectedNumber = Annotated[int | None, Field(ge=1)]


class Cluster(Section):
    """Several machines that share the work over a NATS server with JetStream."""

    nats: tuple[str, ...] = Field(min_length=1)
    """Addresses of the NATS servers, nats://HOST:PORT or tls://HOST:PORT."""
    token: SecretSource = ""
    """Source of the servers' token, `file:PATH` or `env:NAME`. It is read again at every connect."""
    user: str = ""
    """User name, if the servers ask for one instead."""
    password: SecretSource = ""
    """Source of the user's password, `file:PATH` or `env:NAME`. It is read again at every connect."""
    ca: str = ""
    """PEM file of the authority of the servers' certificates; empty for those that this machine trusts."""
    certificate: str = ""
    """PEM file of a client certificate and its key, if the servers ask for one."""
    name: Name = "deconflict"
    """Name of the cluster. All machines with the same name on the same servers form one cluster."""
    share_port: bool = False
    """Whether several ingests on one machine share the robots' port. If not, only the first can open it."""
    tile_m: Annotated[float, Field(ge=10, allow_inf_nan=False)] = 64.0
    """Side of a tile. Small tiles overlap more, large tiles divide the load less evenly."""
    fastest_mps: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 2.0
    """Speed of the fastest robot. It sets how far around its tiles an engine listens. Faster robots load the floor."""
    hot_per_s: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 2000.0
    """A tile with more statuses a second is split into four."""
    copies: Annotated[int, Field(ge=1, le=5)] = 1
    """Number of servers that store each advisory and the last parcels. 3 survives the loss of one."""
    ingests: ExpectedNumber = None
    """Number of ingests that must be there. None: as many as were seen, without those that were stopped."""
    engines: ExpectedNumber = None
    """The same of engines."""
    faces: ExpectedNumber = None
    """The same of operator faces."""

    def expected(self) -> dict[str, int | None]:
        """By part of the service, how many members must be there; None if the site file does not say."""
        return {"ingest": self.ingests, "engine": self.engines, "face": self.faces}


def cluster_contradictions(settings: Cluster | None) -> Iterator[str]:
    """A sentence for each contradiction between keys."""
    if settings is None:
        return
    if settings.token and (settings.user or settings.password):
        yield "cluster.token: is set beside a user or password; servers ask for one or the other"
    if bool(settings.user) != bool(settings.password):
        yield f"cluster.{'password' if settings.user else 'user'}: is missing; user and password go together"
    if settings.certificate and not (settings.ca or any(address.startswith("tls://") for address in settings.nats)):
        yield "cluster.certificate: is used over TLS alone; expected tls:// addresses, or cluster.ca"
