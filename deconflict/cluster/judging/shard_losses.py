"""The losses of one engine's share of the floors.

The owner of the tile in which a robot began to lose time reports the loss. Every engine that sees the robot finds the
same loss, and so exactly one of them owns it. One that first sees the robot when it already loses time takes it to
begin there, which is outside its tiles: it sees robots long before they are in them.
"""

from collections.abc import Callable, Iterable

from deconflict.advisories.loss_warnings import LossWarnings
from deconflict.cluster.tiles.tiles import Area
from deconflict.engine.engine_metrics import count_losses
from deconflict.foresight.losses.loss_places import LossPlaces, PlacedLoss
from deconflict.settings.site import Site
from deconflict_client.situations import AnyRevision, advisories_of
from ingest.batch import FloorPoint
from ingest.measures.measures import Measures


class ShardLosses:
    """Gives the losses of its tiles their places, and what all engines had published when they began."""

    def __init__(self, site: Site, last_advised_wait_s: Callable[[str], float]) -> None:
        """`site` has the resources and zones."""
        self._places = LossPlaces.of(site)
        self._warnings = LossWarnings((), last_advised_wait_s)
        self.measures = Measures()

    def renew(self, site: Site) -> None:
        """Use a changed site file."""
        self._places = LossPlaces.of(site)

    def note(self, now_s: float, revisions: Iterable[AnyRevision]) -> None:
        """Take in the published revisions of all engines."""
        self._warnings.note(now_s, advisories_of(list(revisions)))

    def own(self, losses: Iterable[PlacedLoss], area: Area) -> list[PlacedLoss]:
        """The losses that began in the tiles of `area`, of all that its engine found."""
        own = [
            PlacedLoss(loss, datum, self._places.place_at(datum, loss.x_m, loss.y_m), self._warnings.notice_of(loss))
            for loss, datum, _, _ in losses
            if FloorPoint(datum, loss.x_m, loss.y_m) in area
        ]
        count_losses(self.measures, own)
        return own
