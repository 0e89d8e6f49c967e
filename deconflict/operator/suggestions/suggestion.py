"""Words of suggestions, and the commands that check them."""

import shlex


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
