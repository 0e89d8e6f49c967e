"""One data directory, one service."""

import subprocess
import sys
from pathlib import Path

import pytest

from deconflict.runtime.data_lock import DataTakenError, held
from tests.deconflict.roles.made_service import free_ports
from tests.helpers.patience import PATIENCE_S


def test_a_directory_is_held_until_the_end_by_part(tmp_path: Path) -> None:
    with held(tmp_path, ["ingest"]):
        with held(tmp_path, ["face", "engine"]):
            pass
        with pytest.raises(DataTakenError, match="or --data"), held(tmp_path, ["ingest"]):
            pytest.fail("it is taken")
    with held(tmp_path, ["ingest"]):
        pass


def test_a_second_service_is_told_to_keep_its_data_elsewhere(tmp_path: Path) -> None:
    robots_port, operator_port = free_ports(2)
    ports = ["--robots-port", str(robots_port), "--operator-port", str(operator_port)]
    command = [sys.executable, "-m", "deconflict", "serve", "--data", str(tmp_path), *ports]
    with held(tmp_path, ["ingest"]):
        ended = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert ended.returncode == 2
    assert f"deconflict: {tmp_path} is another service's" in ended.stderr
