"""Lost time as `GET /losses` returns it."""

from typing import Literal

from pydantic import BaseModel, Field

from deconflict_client.answers.filter_models import Filtered

LossKey = Literal["vendor", "model", "by", "root", "kind", "floor", "place", "cell", "hour", "day"]


class LossRow(BaseModel, extra="allow"):
    """The sum of some losses. Further fields are the keys that were asked for."""

    lost_s: float = Field(description="seconds that robots lost")
    over_usual_s: float = Field(
        description="how much longer these robots needed than their models usually do there; where that is not known, "
        "than planned"
    )
    sure_s: float = Field(description="the part whose cause is sure")
    warned_s: float = Field(description="the part of which an advisory warned at least 2 s before")
    advised_s: float = Field(description="the part of these for which one of the two robots was advised")
    heeded_s: float = Field(description="the part of these for which that robot did as advised")
    losses: int = Field(description="number of losses, or parts of long ones")
    refusals: int = Field(description="advice that robots of `by` refused though they can follow it")
    refused_s: float = Field(description="seconds that robots stood because of these refusals, at most 60 s for each")
    unable: int = Field(description="advice that robots of `by` declined because they cannot")
    unable_s: float = Field(description="the same seconds because of these")
    cost: float | None = Field(description="of the robots whose vendor or model has a cost; null if none has")


class LossList(Filtered):
    """Lost time. docs/losses.md defines the figures and has their errors."""

    from_s: float = Field(description="the first hour begins then, seconds since the epoch")
    until_s: float = Field(description="the last hour begins before")
    begun_s: float | None = Field(description="the first loss of the ledger began then; null if there is none")
    currency: str
    total: LossRow
    rows: list[LossRow] = Field(description="one for each combination of the keys, the largest first")
    more: bool = Field(description="true if `limit` left some out")
