"""What several tests of shards need."""

from collections.abc import Iterable

import pytest

from deconflict.foresight.forecast_errors.error_ledger import Ledger
from deconflict.foresight.probability.calibration import Calibration


@pytest.fixture(scope="module")
def untaught() -> Iterable[None]:
    """Each engine learns from the robots that it sees; without learning the figures are the same everywhere."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Ledger, "record", lambda *_: None)
        patch.setattr(Calibration, "learn", lambda *_: None)
        yield
