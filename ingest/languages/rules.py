"""A rule of a standard, and what reading a message against the rules finds. All languages share it."""

from dataclasses import dataclass

from ingest.sizes.size_limit import LOAD_IN_OTHER_UNIT, LOAD_OVER_LIMIT, SIZE_IN_OTHER_UNIT, SIZE_OVER_LIMIT

Findings = dict[str, None]
"""Codes of the deviations of a message, each once, in the order in which they were found. The values are unused."""


@dataclass(frozen=True, slots=True)
class Rule:
    """One kind of deviation or rejection."""

    code: str
    """Its name in metrics. Languages that have the same rule share its code."""
    sentence: str
    """What the message has, and how it is read or what to change."""
    clause: str
    """Of the standard, or `schema` for its published JSON schema."""
    rejects: bool = False
    alone: bool = True
    """Whether one message by itself shows it. If not, it takes the robot's history, the site file or the socket."""


def size_rules(clause: str) -> tuple[Rule, Rule]:
    """The rules of a robot's size. They take the site file and the other robots of its model."""
    return (
        Rule(
            SIZE_IN_OTHER_UNIT,
            "A size is beyond `reading.largest_body_m`, and other figures show millimetres or centimetres; converted.",
            clause,
            alone=False,
        ),
        Rule(
            SIZE_OVER_LIMIT,
            "A size or an offset is beyond `reading.largest_body_m`; the robot is an obstacle of that size.",
            clause,
            alone=False,
        ),
    )


def load_rules(clause: str) -> tuple[Rule, Rule]:
    """The same of loads."""
    return (
        Rule(
            LOAD_IN_OTHER_UNIT,
            "A load is beyond `reading.largest_body_m`; in millimetres or centimetres it fits the robot; converted.",
            clause,
            alone=False,
        ),
        Rule(
            LOAD_OVER_LIMIT,
            "A load, or the robot with it, is beyond `reading.largest_body_m`; it reaches as far as that.",
            clause,
            alone=False,
        ),
    )


class RejectedError(ValueError):
    """A message that is not accepted: the rule that rejects it, and what the sender should change."""

    def __init__(self, rule: str, reason: str, sent_uuid: object = None) -> None:
        super().__init__(f"{rule}: {reason}")
        self.rule, self.reason, self.sent_uuid = rule, reason, sent_uuid
