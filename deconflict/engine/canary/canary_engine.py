"""What the engine makes of a canary."""

import logging
from typing import Any

from pydantic_core import to_jsonable_python

from deconflict.engine.canary.canary_parcel import Canary
from deconflict.engine.engine import Engine
from deconflict.settings.site import Site
from deconflict_client.advisory import AnyAdvisory
from ingest.batch import Batch

log = logging.getLogger(__name__)


def judged(canary: Canary) -> dict[str, Any]:
    """The canary's part of a parcel: when it was due, and the advisory; None if there was no warning of the pair."""
    try:
        revisions = _revisions(Batch.from_bytes(canary.batch))
    except Exception:
        log.exception("the engine can't judge a made-up conflict")
        revisions = []
    return {"due_s": canary.due_s, "advisory": to_jsonable_python(revisions[0]) if revisions else None}


def _revisions(batch: Batch) -> list[AnyAdvisory]:
    engine = Engine(Site(), conflicts_only=True)
    engine.receive(batch)
    return engine.step(batch.now_s)
