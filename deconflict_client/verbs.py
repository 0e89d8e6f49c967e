"""What may be asked of a robot. A module of its own: programs that only follow the service load it without numpy."""

from typing import Literal

Verb = Literal["wait_before", "go_first", "step_aside", "go_around", "back_out", "other_way"]
