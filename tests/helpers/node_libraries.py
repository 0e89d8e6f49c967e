"""JavaScript libraries for tests, which `.ci/run` installs from npm."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

FOLDER = Path("build/node/node_modules")
ENVIRONMENT = os.environ | {"NODE_PATH": os.environ.get("NODE_PATH") or str(FOLDER.absolute())}


def needs_library(name: str) -> pytest.MarkDecorator:
    """Skips a test where node or a library is not installed."""
    return pytest.mark.skipif(not _has(name), reason=f"npm install --prefix build/node {name}")


def _has(name: str) -> bool:
    if not shutil.which("node"):
        return False
    find = ["node", "-e", f"require.resolve({name!r})"]
    return subprocess.run(find, env=ENVIRONMENT, capture_output=True, check=False).returncode == 0
