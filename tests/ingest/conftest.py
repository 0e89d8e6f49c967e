"""What the tests of the robots' port share."""

from pathlib import Path

import pytest
import trustme

from ingest.settings import Tls
from tests.ingest.security.made_tls import write


@pytest.fixture
def authority() -> trustme.CA:
    return trustme.CA()


@pytest.fixture
def site_tls(authority: trustme.CA, tmp_path: Path) -> Tls:
    write(authority, tmp_path)
    return Tls(certificate=str(tmp_path / "site.pem"))
