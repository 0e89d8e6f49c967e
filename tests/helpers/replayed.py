"""The advisories, situations and losses of an engine for a recording, pass by pass as it was recorded."""

from collections.abc import Iterator
from pathlib import Path

from deconflict.advisories.situations.situation_lifecycle import SituationLifecycle
from deconflict.advisories.words.place_names import PlaceNames
from deconflict.engine.engine import Engine
from deconflict.engine.load_shedding import Effort
from deconflict.operator.ledger.loss_ledger import LedgerEntry, ledger_entries
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from deconflict_client.advisory import AnyAdvisory
from deconflict_client.situations import AnyRevision
from ingest.measures.measures import Measures
from ingest.recording.log_reader import EngineStarted, LogReader, Received, Tick


def replayed(log: Path, site: Site) -> list[AnyRevision]:
    """All revisions, with the effort and the answers that the recorded passes had."""
    situations, revisions = SituationLifecycle(PlaceNames.of(site).describe), list[AnyRevision]()
    for now_s, _, advisories in _passes(log, site):
        revisions += situations.published(now_s, advisories)
    return revisions


def replayed_losses(log: Path, site: Site) -> list[LedgerEntry]:
    """All losses, as the ledger takes them."""
    return [entry for _, engine, _ in _passes(log, site) for entry in ledger_entries(engine.losses)]


def _passes(log: Path, site: Site) -> Iterator[tuple[float, Engine, list[AnyAdvisory]]]:
    fleet, engine, everything = fleet_of(site, Measures()), Engine(site), False
    for event in LogReader().read([log]):
        if isinstance(event, Received):
            fleet.receive(event.raw, event.arrival_s, event.connection)
        elif isinstance(event, EngineStarted):
            everything = True
        elif isinstance(event, Tick):
            engine.receive(fleet.next_batch(event.now_s, everything))
            everything = False
            advisories = engine.step(event.now_s, Effort(event.effort), event.pending, followed=event.followed)
            if event.effort < Effort.NEAR:
                engine.advise(event.now_s)
            yield event.now_s, engine, advisories
