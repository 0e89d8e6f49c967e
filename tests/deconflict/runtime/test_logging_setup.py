import json
import logging
import subprocess
import sys
import time
from io import StringIO
from pathlib import Path

import pytest

from deconflict.runtime import logging_setup
from deconflict.runtime.logging_setup import HIDDEN, MOST_ALIKE, WITHIN_S, hidden
from ingest.languages import timestamps
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import identity


@pytest.fixture
def now_s() -> list[float]:
    return [0.0]


@pytest.fixture
def log_text() -> StringIO:
    return StringIO()


@pytest.fixture
def log(now_s: list[float], log_text: StringIO) -> logging.Logger:
    """A logger without a parent: the runner of parallel tests can't carry a record with a lone surrogate."""
    logger = logging.Logger("deconflict.test")
    logger.addHandler(logging_setup.create_handler("json", lambda: now_s[0], log_text))
    return logger


def test_any_record_is_logged_as_one_json_object(log: logging.Logger, log_text: StringIO) -> None:
    log.warning('the %s said "%s"\nand \ud800 left', "robot", "no")
    try:
        raise ValueError("too far")
    except ValueError:
        log.exception("it failed")
    first, second = (json.loads(line) for line in log_text.getvalue().splitlines())
    assert (first["level"], first["logger"]) == ("warning", "deconflict.test")
    assert first["said"] == 'the robot said "no"\nand \\ud800 left'
    assert second["error"].endswith("ValueError: too far")


def test_repeated_records_of_one_place_are_limited_and_counted_and_hide_no_other(
    log: logging.Logger, now_s: list[float], log_text: StringIO
) -> None:
    def say(number: int) -> None:
        log.warning("connection %d is turned away", number)

    for number in range(10_000):
        say(number)
    log.error("the disk is full")
    lines = log_text.getvalue().splitlines()
    assert len(lines) == MOST_ALIKE + 1
    assert json.loads(lines[-1])["said"] == "the disk is full"
    now_s[0] += WITHIN_S
    say(7)
    assert (
        json.loads(log_text.getvalue().splitlines()[-1])["said"]
        == f"connection 7 is turned away ({10_000 - MOST_ALIKE} like this were left out)"
    )


@pytest.mark.parametrize(
    "text",
    [
        "401 for Authorization: Bearer s3cr3t-t0ken",
        "POST https://hooks.example/in?token=s3cr3t-t0ken&x=1",
        "mqtt://kim:s3cr3t-t0ken@broker:1883 does not answer",
        "{'password': 's3cr3t-t0ken', 'user': 'kim'}",
        'api_key = "s3cr3t-t0ken"',
    ],
)
def test_text_that_looks_like_a_secret_is_hidden(text: str) -> None:
    assert "s3cr3t-t0ken" not in hidden(text)
    assert HIDDEN in hidden(text)


@pytest.mark.parametrize(
    "text",
    [
        "vendors[0].token: env:ALDER_TOKEN is not set",
        "file:/etc/token can't be read",
        "Bearer is missing",
        "at 10:05:06",
        "Basalt at ws://10.20.0.5:900000/robots can't be reached",
    ],
)
def test_text_without_a_secret_is_unchanged(text: str) -> None:
    assert hidden(text) == text


def test_every_process_of_the_service_logs_in_the_chosen_format(tmp_path: Path) -> None:
    (tmp_path / "log").mkdir()
    now_s = time.time()
    line = f'{{"received":"{timestamps.write(now_s)}","message":{identity("A-1", now_s).decode()}}}\n'
    (tmp_path / "log" / "log-1.jsonl").write_text(line)
    command = [sys.executable, "-m", "deconflict", "--log", "json", "serve", "--data", str(tmp_path)]
    ports = ["--robots-port", "0", "--operator-port", "0"]
    with subprocess.Popen([*command, *ports], stderr=subprocess.PIPE, text=True) as service:
        assert service.stderr
        supervisor_line, role_line = (json.loads(service.stderr.readline()) for _ in range(2))
        service.terminate()
        service.communicate(timeout=PATIENCE_S)
    assert supervisor_line["process"] == service.pid
    assert supervisor_line["said"].startswith("no site file")
    assert (role_line["logger"], role_line["process"] != service.pid) == ("deconflict.roles.receiver_role", True)


@pytest.mark.parametrize("kind", ["text", "json"])
def test_no_name_makes_a_line_of_the_log_or_controls_a_terminal(kind: str) -> None:
    text = StringIO()
    logger = logging.Logger("deconflict.test")
    logger.addHandler(logging_setup.create_handler(kind, lambda: 0.0, text))
    hostile = "x\n2026-11-23 08:00:00 ERROR forged\r\x1b[2J\x9b\u202e\u2028"
    try:
        raise ValueError(hostile)
    except ValueError:
        logger.exception("robot %s", hostile)
    lines = text.getvalue().removesuffix("\n").split("\n")
    assert all(line.isprintable() for line in lines)
    if kind == "json":
        assert json.loads(lines[0])["said"] == f"robot {hostile}"
        assert len(lines) == 1
    else:
        assert "robot x\\n2026" in lines[0]
        assert all(line.startswith("    ") for line in lines[1:])
