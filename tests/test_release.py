"""Locks with hashes for every pin, and a release that is signed and verified as docs/release.md says."""

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.helpers.dependencies import ROOT, needed, pinned

LOCKS = {path.stem: path.read_text() for path in (ROOT / "locks").glob("*.txt")}
SERVICE, CLIENT = (
    tomllib.loads((ROOT / folder / "pyproject.toml").read_text())["project"] for folder in ("", "deconflict_client")
)
OF_WINDOWS = {"colorama"}
"""Packages that are needed there only; nothing is tested there."""


def locked(lock: str) -> dict[str, str]:
    """Package to version."""
    found = re.findall(r"^([\w.-]+)==(\S+)", LOCKS[lock], re.M)
    return {canonicalize_name(name): version for name, version in found}


@pytest.mark.parametrize("lock", sorted(LOCKS))
def test_every_pin_has_hashes_and_no_address(lock: str) -> None:
    for entry in re.split(r"\n(?! )", LOCKS[lock].strip()):
        head, *hashes = entry.split(" \\\n")
        assert re.fullmatch(r"[\w.-]+==[\w.]+( ; [^@]+)?", head), "run make lock"
        assert hashes
        assert all(re.fullmatch(r" +--hash=sha256:[0-9a-f]{64}", each) for each in hashes)
    versions = locked(lock)
    wrong = {name: version for name, version in versions.items() if pinned().get(name) != version}
    assert wrong.keys() <= OF_WINDOWS, "run make lock"


def test_what_runs_and_what_builds_it_is_locked() -> None:
    assert set(LOCKS) == {"runtime", "build", "development", "client"}
    assert locked("client").items() <= locked("runtime").items()
    assert {canonicalize_name(Requirement(each).name) for each in CLIENT["dependencies"]} <= locked("client").keys()
    assert needed().keys() <= locked("runtime").keys(), "run make lock"
    cluster = {canonicalize_name(Requirement(each).name) for each in SERVICE["optional-dependencies"]["cluster"]}
    assert cluster
    assert cluster <= locked("runtime").keys(), "what is installed from the lock takes part in a cluster"
    assert locked("runtime").keys() <= locked("development").keys()
    assert "hatchling" in locked("build")
    assert pinned().keys() <= locked("development").keys() | locked("build").keys(), "run make lock"


def test_the_client_has_the_version_of_the_service_and_asks_for_nothing_else() -> None:
    """The build lets the service need the client by its own name and version."""
    assert (CLIENT["name"], CLIENT["version"]) == (f"{SERVICE['name']}-client", SERVICE["version"])
    assert CLIENT["requires-python"] == SERVICE["requires-python"]
    assert set(CLIENT["dependencies"]) <= set(SERVICE["dependencies"])


@pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="ssh-keygen is not installed")
def test_a_signed_release_is_verified_as_documented_and_a_changed_one_refused(tmp_path: Path) -> None:
    key, release = tmp_path / "key", tmp_path / "release"
    release.mkdir()
    wheel = release / "amr_deconflict-1-py3-none-any.whl"
    wheel.write_bytes(b"wheel")
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", "release", "-f", str(key)], check=True)
    subprocess.run(["make", "-s", "sign", f"DIST={release}", f"KEY={key}"], cwd=ROOT, check=True)
    (release / "allowed_signers").write_text(f"release {key.with_suffix('.pub').read_text()}")
    page = (ROOT / "docs" / "release.md").read_text()
    verify = [re.search(rf"^{command}.*$", page, re.M)[0] for command in ("ssh-keygen -Y verify", "sha256sum")]  # type: ignore[index]

    def is_verified() -> bool:
        done = subprocess.run(["sh", "-c", " && ".join(verify)], cwd=release, capture_output=True, check=False)
        return done.returncode == 0

    assert is_verified()
    wheel.write_bytes(b"another")
    assert not is_verified()
    subprocess.run(["sh", "-c", "sha256sum -- *.whl > SHA256SUMS"], cwd=release, check=True)
    assert not is_verified()


def test_a_release_is_not_signed_without_a_key(tmp_path: Path) -> None:
    command = ["make", "-s", "sign", f"DIST={tmp_path}"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode
    assert "Set KEY" in done.stdout
