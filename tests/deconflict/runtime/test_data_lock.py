import subprocess
import sys
from pathlib import Path

import pytest

from deconflict.runtime.data_lock import DataDirectoryError, create_data_directory, locked
from tests.deconflict.roles.made_service import free_ports
from tests.helpers.patience import PATIENCE_S


def test_a_directory_is_locked_part_by_part(tmp_path: Path) -> None:
    with locked(tmp_path, ["ingest"]):
        with locked(tmp_path, ["face", "engine"]):
            pass
        with pytest.raises(DataDirectoryError, match="or --data"), locked(tmp_path, ["ingest"]):
            pytest.fail("it is taken")
    with locked(tmp_path, ["ingest"]):
        pass


@pytest.mark.parametrize("words", [["serve"], ["demo", "--seconds", "1"]], ids=" ".join)
def test_a_second_service_in_the_same_directory_ends_with_an_error(tmp_path: Path, words: list[str]) -> None:
    robots_port, operator_port = free_ports(2)
    ports = ["--robots-port", str(robots_port), "--operator-port", str(operator_port)]
    command = [sys.executable, "-m", "deconflict", *words, "--data", str(tmp_path), *ports]
    with locked(tmp_path, ["ingest"]):
        ended = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert ended.returncode == 2
    assert f"deconflict: {tmp_path} is in use by another service" in ended.stderr


def test_what_is_written_is_for_user_and_group_only_and_a_stricter_umask_stays(tmp_path: Path) -> None:
    code = (
        "import os, sys; from pathlib import Path; from deconflict.runtime.data_lock import create_data_directory\n"
        "os.umask(int(sys.argv[2], 8)); data = Path(sys.argv[1]); create_data_directory(data); (data / 'file').touch()"
    )
    for umask, modes in (("022", (0o750, 0o640)), ("077", (0o700, 0o600))):
        data = tmp_path / umask
        subprocess.run([sys.executable, "-c", code, str(data), umask], check=True)
        assert (data.stat().st_mode & 0o777, (data / "file").stat().st_mode & 0o777) == modes


def test_files_of_an_earlier_release_get_the_rights_of_today(tmp_path: Path) -> None:
    data, elsewhere = tmp_path / "data", tmp_path / "elsewhere"
    for folder in (data, data / "log"):
        folder.mkdir()
        folder.chmod(0o755)
    files = {name: data / name for name in ("advisories.db", "owners.json", "log/1.jsonl", "of-others")}
    for file in (*files.values(), elsewhere):
        file.touch()
        file.chmod(0o666)
    (data / "log" / "link").symlink_to(elsewhere)
    code = "import sys; from pathlib import Path; from deconflict.runtime.data_lock import create_data_directory\n"
    subprocess.run([sys.executable, "-c", f"{code}create_data_directory(Path(sys.argv[1]))", str(data)], check=True)
    assert [path.stat().st_mode & 0o777 for path in (data, data / "log")] == [0o755, 0o750]
    assert {name: file.stat().st_mode & 0o777 for name, file in files.items()} == {
        "advisories.db": 0o640,
        "owners.json": 0o640,
        "log/1.jsonl": 0o640,
        "of-others": 0o666,
    }
    assert elsewhere.stat().st_mode & 0o777 == 0o666


def test_a_data_directory_that_cannot_be_made_is_explained(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    with pytest.raises(DataDirectoryError, match="can't be made a data directory: Not a directory; set another"):
        create_data_directory(file / "data")
