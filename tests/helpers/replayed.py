"""The advisories and situations of an engine for a recording, pass by pass as it was recorded."""

from pathlib import Path

from deconflict.advisories.situations.situation import AnyRevision
from deconflict.advisories.situations.situation_lifecycle import SituationLifecycle
from deconflict.engine.engine import Engine
from deconflict.engine.load_shedding import Effort
from deconflict.engine.place_names import PlaceNames
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from ingest.measures.measures import Measures
from ingest.recording.log_reader import EngineStarted, LogReader, Received, Tick


def replayed(log: Path, site: Site) -> list[AnyRevision]:
    """All revisions, with the effort and the answers that the recorded passes had."""
    fleet, engine, revisions = fleet_of(site, Measures()), Engine(site), list[AnyRevision]()
    situations = SituationLifecycle(PlaceNames.of(site).describe)
    everything = False
    for event in LogReader().read([log]):
        if isinstance(event, Received):
            fleet.receive(event.raw, event.arrival_s, event.connection)
        elif isinstance(event, EngineStarted):
            everything = True
        elif isinstance(event, Tick):
            engine.receive(fleet.next_batch(event.now_s, everything))
            everything = False
            advisories = engine.step(event.now_s, Effort(event.effort), event.pending)
            revisions += situations.published(event.now_s, advisories)
    return revisions
