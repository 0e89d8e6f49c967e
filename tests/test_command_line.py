"""The command line explains itself, and the same fault has the same exit code."""

import argparse
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from deconflict.__main__ import parser
from deconflict.runtime.command_parsers import MISUSED


def commands(root: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    for action in root._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield command
                yield from commands(command)


COMMANDS = list(commands(parser()))


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.prog)
def test_every_argument_has_help(command: argparse.ArgumentParser) -> None:
    parts = (argparse._SubParsersAction,)
    assert not [action.dest for action in command._actions if not action.help and not isinstance(action, parts)]


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.prog)
def test_every_command_has_an_example_that_is_understood(command: argparse.ArgumentParser) -> None:
    examples = re.findall(r"^  deconflict ([^#>\n]*)", command.epilog or "", re.M)
    assert examples
    for example in examples:
        assert parser().parse_args(example.split()).run


def test_a_reader_that_has_seen_enough_is_no_fault() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "deconflict", "schema", "openapi"]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, "")


def test_an_output_that_takes_nothing_more_is_a_sentence() -> None:
    command = [sys.executable, "-m", "deconflict", "schema", "openapi"]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    expected = "deconflict: standard output can't be written: No space left on device\n"
    assert (done.returncode, done.stderr) == (MISUSED, expected)


@pytest.mark.parametrize("closed", ["<&-", ">&-", "<&- >&-"])
def test_a_command_without_some_standard_streams_runs(closed: str) -> None:
    command = f"exec '{sys.executable}' -m deconflict schema site {closed}"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_robots_that_reach_no_service_say_so() -> None:
    command = [sys.executable, "-m", "deconflict", "simulate", "--url", "ws://127.0.0.1:1", "--seconds", "0.3"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (
        MISUSED,
        "deconflict: nothing was sent: no service answers at ws://127.0.0.1:1\n",
    )


@pytest.mark.parametrize(
    ("line", "meant"),
    [("demo --secnds 3", "--seconds"), ("--versoin check x", "--version"), ("site import x --widht=2", "--width")],
)
def test_an_option_that_does_not_exist_names_the_one_that_was_meant(
    line: str, meant: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        parser().parse_args(line.split())
    assert (end.value.code, capsys.readouterr().err.endswith(f"; did you mean {meant}?\n")) == (MISUSED, True)


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("chek x", "check"),
        ("blackbox lst", "list"),
        ("site imprt x", "import"),
        ("schema advisry", "advisory"),
        ("--log jsn check x", "json"),
    ],
)
def test_a_command_or_choice_that_does_not_exist_names_the_one_that_was_meant(
    line: str, meant: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        parser().parse_args(line.split())
    assert (end.value.code, capsys.readouterr().err.endswith(f"; did you mean {meant}?\n")) == (MISUSED, True)


def test_a_command_that_is_near_to_none_lists_all(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parser().parse_args(["qqqq"])
    assert "choose from 'demo'" in capsys.readouterr().err


def test_the_scene_of_standoffs_turns_advice_off_and_on_by_itself() -> None:
    command = [sys.executable, "-m", "deconflict", "demo", "--scene", "standoffs", "--advice"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.startswith("deconflict: leave out --advice")) == (MISUSED, True)


@pytest.mark.parametrize(
    "arguments",
    [
        "serve",
        "check",
        "replay --site",
        "conform --site",
        "site import",
        "replay",
        "conform",
        "blackbox list --data",
        "blackbox verify",
        "losses --data",
    ],
)
def test_a_file_that_is_missing_ends_every_command_with_the_same_code(arguments: str, tmp_path: Path) -> None:
    words = [*arguments.split(), str(tmp_path / "missing")]
    log = [str(Path(__file__))] if words[0] in ("replay", "conform") and "--site" in words else []
    done = subprocess.run(
        [sys.executable, "-m", "deconflict", *words, *log], capture_output=True, text=True, check=False
    )
    assert done.returncode == MISUSED
    assert "missing" in done.stdout + done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_tab_completes_commands_and_options(shell: str) -> None:
    command = [sys.executable, "-m", "deconflict", "completion", shell]
    script = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert "--operator-port" in script
    if shell == "bash":
        subprocess.run(["bash", "-n"], input=script, text=True, check=True)


WITHOUT_NATS = "import sys; sys.modules['nats'] = None; from deconflict.__main__ import main; sys.exit(main())"


@pytest.mark.parametrize("command", ["check", "serve"])
def test_a_cluster_without_the_client_of_nats_is_refused_with_what_to_install(command: str, tmp_path: Path) -> None:
    file = tmp_path / "site.toml"
    file.write_text('[cluster]\nnats = ["nats://127.0.0.1:4222"]\n', encoding="utf-8")
    words = [sys.executable, "-c", WITHOUT_NATS, command, str(file)]
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == MISUSED
    assert "cluster.nats: needs the NATS client; pip install 'amr-deconflict[cluster]'" in done.stdout + done.stderr
