"""What the site file says of a cluster."""

from typing import Annotated

from pydantic import Field, StringConstraints

from ingest.settings import Section

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]+$")]


class Cluster(Section):
    """Several machines that share the work over a NATS server with JetStream."""

    nats: tuple[str, ...] = Field(min_length=1)
    """Addresses of its servers, nats://HOST:PORT or tls://HOST:PORT."""
    name: Name = "deconflict"
    """Whoever uses the same name on the same server is one cluster."""
    tile_m: Annotated[float, Field(ge=10, allow_inf_nan=False)] = 64.0
    """Side of the tiles that floors are shared out in. Small ones overlap more, large ones share less well."""
    fastest_mps: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 2.0
    """Speed of the fastest robot, for how far around its tiles an engine listens. What is quicker is told its floor."""
    hot_per_s: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 2000.0
    """A tile with more statuses a second is split in four."""
    copies: Annotated[int, Field(ge=1, le=5)] = 1
    """How many servers keep each advisory; 3 survives the loss of one."""
