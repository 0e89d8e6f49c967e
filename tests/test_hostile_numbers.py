"""Whatever number a command is given, it takes it and ends well, or refuses it with a sentence and exit code 2."""

import argparse
from collections.abc import Iterator
from contextlib import closing, suppress
from math import isfinite
from pathlib import Path

import numpy as np
import pytest

from deconflict import __main__
from deconflict.operator.ledger.loss_ledger import LossLedger
from deconflict.runtime.command_parsers import MISUSED
from deconflict.runtime.systemd import Notifier
from deconflict.settings import overrides, site
from deconflict.settings.site_file import SiteError
from deconflict.simulation.simulation_commands import _broker
from metrics.export.ledger_commands import MOST_DAYS, _moment_s
from metrics.whatif.change import ChangeError
from metrics.whatif.whatif_question import _metres, _share

NUMBERS = ["1e308", "-1e308", "nan", "-nan", "inf", "-inf", "-1", "-0.0", "0", "1e-300", "9" * 400, "9" * 5000]
NUMBERS += ["1e400", "0x10", "1_0", "1,5", "²", "٣", "", " ", "\0", "1" + "0" * 30]
LONGEST_SENTENCE = 300
SOUND_UP_TO = 2**33
"""No number that is taken is larger: a count of this much is not made, a time lies in the years of a calendar."""
TIMES = ["0001-01-01", "1969-12-31", "9999-12-31T23:59:59-23:59", "0001-01-01T00:00:00+23:00", "2026-02-30", "now"]
PARSER = __main__.parser()


def commands(root: argparse.ArgumentParser, *names: str) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """Every command that runs, by its words."""
    parts = [action for action in root._actions if isinstance(action, argparse._SubParsersAction)]
    if not parts:
        yield " ".join(names), root
    for action in parts:
        for name, command in action.choices.items():
            yield from commands(command, *names, name)


def numeric(action: argparse.Action) -> bool:
    """Whether an argument that is written as 7 is taken for a number."""
    if not callable(action.type) or action.type is Path:
        return False
    try:
        return isinstance(action.type("7"), int | float)
    except (argparse.ArgumentTypeError, ValueError):
        return False


OPTIONS = [(name, action) for name, command in commands(PARSER) for action in command._actions if numeric(action)]


def test_the_options_with_numbers_are_found() -> None:
    found = {f"{name} {action.option_strings[0]}" for name, action in OPTIONS}
    assert {"demo --robots", "losses --days", "site new --seconds", "site import --width", "whatif --seeds"} <= found
    assert {"replay --clearance", "serve --robots-port", "senders --seconds", "simulate --seed"} <= found


@pytest.mark.parametrize(("name", "action"), OPTIONS, ids=lambda part: getattr(part, "dest", part))
def test_a_number_is_taken_if_it_makes_sense_and_refused_in_one_sentence_otherwise(
    name: str, action: argparse.Action, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [*name.split(), *(["log"] if name in ("replay", "site import") else [])]
    words += ["log", "--suggest"] if name == "whatif" else []
    for text in NUMBERS:
        try:
            taken = getattr(PARSER.parse_args([*words, f"{action.option_strings[0]}={text}"]), action.dest)
            faults = [each for each in np.atleast_1d(taken) if not 0 <= each <= SOUND_UP_TO]
        except SystemExit as ended:
            sentence = capsys.readouterr().err.splitlines()[-1]
            faults = [ended.code, sentence] if ended.code != MISUSED or len(sentence) > LONGEST_SENTENCE else []
        assert not faults, text


@pytest.mark.parametrize("days", ["0", "1e-300", str(MOST_DAYS)])
@pytest.mark.parametrize("until", ["1970-01-02", "9998-12-31T23:59:59", ""])
def test_the_longest_and_the_shortest_span_of_losses_can_be_reported(tmp_path: Path, days: str, until: str) -> None:
    with closing(LossLedger(tmp_path, site.LossSettings())):
        pass
    page, sums = tmp_path / "page.html", tmp_path / "sums.csv"
    words = ["losses", "--data", str(tmp_path), "--days", days, "--html", str(page), "--csv", str(sums)]
    args = PARSER.parse_args([*words, *(["--until", until] if until else [])])
    assert args.run(args) == 0
    assert page.stat().st_size < 1 << 20


@pytest.mark.parametrize("text", [*TIMES, *NUMBERS])
def test_a_time_outside_the_calendar_is_refused(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="is no time"):
        _moment_s(text)


@pytest.mark.parametrize("text", NUMBERS)
def test_numbers_within_other_arguments_are_refused_or_sound(text: str) -> None:
    with suppress(argparse.ArgumentTypeError):
        assert 0 < _broker(f"broker:{text}")[1] < 1 << 16
    with suppress(ChangeError):
        assert 0.1 <= (_metres([text]) or 0) < 10
    with suppress(ChangeError):
        assert 0.1 <= _share(text) <= 1


SETTINGS = [".".join(key) for key in overrides._keys()]


@pytest.mark.parametrize("text", ["1e308", "-1e308", "nan", "inf", "-1", "-0.0", "1e-300", "9" * 400, "9" * 5000])
def test_a_setting_takes_no_number_that_is_none(text: str) -> None:
    for key in SETTINGS:
        with suppress(SiteError):
            changed = overrides.with_overrides(site.DEFAULT, [f"{key}={text}"])
            section, _, name = key.partition(".")
            assert isfinite(getattr(getattr(changed, section), name)), key


def test_the_service_manager_may_give_any_number(caplog: pytest.LogCaptureFixture) -> None:
    for text in NUMBERS:
        Notifier({"WATCHDOG_USEC": text}).send_watchdog(0.0)
    assert "WATCHDOG_USEC is no number" in caplog.text
