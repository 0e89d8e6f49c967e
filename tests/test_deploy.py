"""The unit file is one that systemd accepts and calls well shut in."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from deconflict.__main__ import parser

UNIT = Path(__file__).parent.parent / "deploy" / "deconflict.service"
needs_systemd = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")


def analyze(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["systemd-analyze", *arguments], capture_output=True, text=True, check=False)


@needs_systemd
def test_systemd_accepts_the_unit(tmp_path: Path) -> None:
    runnable = tmp_path / UNIT.name
    runnable.write_text(re.sub(r"ExecStart=\S+", "ExecStart=/bin/true", UNIT.read_text()))
    judged = analyze("verify", "--man=no", str(runnable))
    assert (judged.returncode, judged.stderr) == (0, "")


@needs_systemd
def test_the_unit_is_shut_in() -> None:
    judged = analyze("security", "--offline=true", str(UNIT)).stdout
    exposure = re.search(r"exposure level for \S+: ([\d.]+)", judged)
    assert exposure, judged
    assert float(exposure[1]) <= 2.0


def test_a_reload_asks_the_service_to_read_its_site_file_again() -> None:
    assert re.search(r"^ExecReload=/bin/kill -HUP \$MAINPID$", UNIT.read_text(), re.M)


def test_the_command_of_the_unit_exists() -> None:
    command = re.search(r"^ExecStart=\S+/deconflict (.+)$", UNIT.read_text(), re.M)
    assert command
    assert parser().parse_args(command[1].split()).command == "serve"
