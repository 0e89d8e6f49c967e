import os
import subprocess
import sys
import time
from pathlib import Path

from deconflict.runtime.logging_setup import WAIT_S, UnhurriedOutput
from tests.helpers.patience import PATIENCE_S

LINES = 50
LOGGING_INTO_A_FULL_PIPE = f"""
import logging
from deconflict.runtime.logging_setup import begin
begin("text")
for number in range({LINES}):
    logging.getLogger("test").warning("%s", number)
print("went on", flush=True)
"""


def _filled_pipe() -> tuple[int, int]:
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    try:
        while os.write(writing, b"." * 4096):
            pass
    except BlockingIOError:
        os.set_blocking(writing, True)
    return reading, writing


def _read_until(reading: int, last: bytes) -> bytes:
    text = b""
    while last not in text:
        text += os.read(reading, 1 << 16)
    return text


def test_a_program_whose_log_nobody_reads_goes_on_and_ends() -> None:
    reading, writing = _filled_pipe()
    command = [sys.executable, "-c", LOGGING_INTO_A_FULL_PIPE]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=writing, timeout=PATIENCE_S, check=True)
    os.close(reading)
    os.close(writing)
    assert done.stdout == b"went on\n"


def test_a_line_is_written_when_logging_returns_and_waits_once_if_nobody_reads() -> None:
    reading, writing = os.pipe()
    output = UnhurriedOutput(writing)
    output.write("read\n")
    os.set_blocking(reading, False)
    assert os.read(reading, 100) == b"read\n"
    os.set_blocking(reading, True)
    full, stuck = _filled_pipe()
    output = UnhurriedOutput(stuck)
    began_s = time.monotonic()
    for number in range(LINES):
        output.write(f"line {number}\n")
    assert WAIT_S <= time.monotonic() - began_s < LINES * WAIT_S / 2
    text = _read_until(full, b"line %d\n" % (LINES - 1))
    assert text.lstrip(b".") == b"".join(b"line %d\n" % number for number in range(LINES))


def test_lines_beyond_the_limit_are_left_out_and_counted_once_somebody_reads() -> None:
    full, stuck = _filled_pipe()
    output = UnhurriedOutput(stuck, most_bytes=200)
    for _ in range(LINES):
        output.write("x" * 99 + "\n")
    text = _read_until(full, b"nobody read standard error\n").lstrip(b".")
    written = text.count(b"x\n")
    assert 1 <= written <= 3
    assert b"%d lines of the log were left out" % (LINES - written) in text


def test_a_forked_process_logs_though_the_first_one_waits(tmp_path: Path) -> None:
    full, stuck = _filled_pipe()
    output = UnhurriedOutput(stuck)
    output.write("the first one waits\n")
    child = os.fork()
    if child == 0:
        output._descriptor = os.open(tmp_path / "child", os.O_WRONLY | os.O_CREAT)
        output.write("the child\n")
        os._exit(0)
    os.waitpid(child, 0)
    assert (tmp_path / "child").read_bytes() == b"the child\n"
    assert _read_until(full, b"waits\n").count(b"waits") == 1
