"""Words of suggestions, the commands that check them, and what they are expected to save."""

import shlex

from deconflict_client.answers.suggestion_models import Saving


def whatif_command(*options: str) -> str:
    """The command that checks a suggestion; LOG and SITE.toml are to be replaced."""
    return shlex.join(["deconflict", "whatif", "LOG", "--site", "SITE.toml", *options])


def minutes(seconds: float) -> str:
    """A length of time for people."""
    return f"{seconds / 60:.0f} min" if seconds >= 120 else f"{seconds:.0f} s"


def minutes_between(low_s: float, high_s: float) -> str:
    if high_s >= 120:
        low, high = f"{low_s / 60:.0f}", f"{high_s / 60:.0f} min"
    else:
        low, high = f"{low_s:.0f}", f"{high_s:.0f} s"
    return f"{low} to {high}"


def expected_s(saving: Saving | None) -> float:
    """Seconds an hour, in the middle of the range."""
    return (saving.low_s_per_hour + saving.high_s_per_hour) / 2 if saving else 0.0
