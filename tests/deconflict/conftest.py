"""What tests of several parts of the service use."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from deconflict.operator.store.store import Store


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    opened = Store(tmp_path)
    yield opened
    opened.close()
