"""Advice as published: what is asked of one robot, from raised to cleared."""

from datetime import datetime
from typing import Literal

from pydantic import Field

from deconflict_client.advisory import Advisory, Location, Robot
from deconflict_client.verbs import Side, Verb

ASKED, ENDED = "deconflict_advice_asked_total", "deconflict_advice_ended_total"
YIELDED = "deconflict_advice_yielded_seconds_total"
REFUSED, REFUSED_S = "deconflict_advice_refused_total", "deconflict_advice_refused_seconds_total"
"""Metrics of what was asked, of what became of it, of who yields to whom, and of what was refused."""


class RobotAdvice(Advisory):
    """What one robot is asked to do so that all lose less time. Its vendor answers; no robot is moved by it."""

    kind: Literal["advice"] = "advice"
    recommendation: None = Field(default=None, exclude=True)
    location: Location = Field(description="where the robot was when it was asked")
    robot: Robot = Field(description="UUID of the robot that is asked")
    vendor: str = Field(description="the vendor that is asked: only it may answer")
    verb: Verb
    place: Location | None = Field(
        default=None,
        description="where to go, or the point of its way not to pass; with `side` the point beside `other` that it "
        "drives over; null if the verb needs none",
    )
    side: Side | None = Field(
        default=None,
        description="on which side of `other` to go around it, seen along the way of the robot; null for other verbs, "
        "and where the robot chooses",
    )
    place_text: str = Field(default="", description="the same for people; empty if there is no place")
    other: Robot | None = Field(default=None, description="UUID of the robot for which it is asked")
    until: tuple[Robot, ...] = Field(default=(), description="UUIDs of the robots that must have passed")
    latest_at: datetime = Field(description="when it ends at the latest")
    saving_s: float | None = Field(
        default=None, description="seconds that all robots are expected to save in the next minute"
    )
    saving_interval_s: tuple[float, float] | None = Field(default=None, description="80 % interval of these seconds")
    begun_at: datetime | None = Field(default=None, description="when the robot had visibly begun")
