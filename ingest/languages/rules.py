"""A rule of a standard, and what reading a message against the rules finds. All languages share it."""

from dataclasses import dataclass

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


class RejectedError(ValueError):
    """A message that is not accepted: the rule that rejects it, and what the sender should change."""

    def __init__(self, rule: str, reason: str, sent_uuid: object = None) -> None:
        super().__init__(f"{rule}: {reason}")
        self.rule, self.reason, self.sent_uuid = rule, reason, sent_uuid
