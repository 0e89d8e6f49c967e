"""The fleet of one ingest."""

from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from ingest.fleet.fleet import Fleet
from ingest.measures.measures import Measures
from tests.deconflict.roles.made_queues import SITE


def fleet(site: Site = SITE) -> Fleet:
    return fleet_of(site, Measures())
