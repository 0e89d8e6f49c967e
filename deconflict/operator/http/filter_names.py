"""Which names of a filter nobody known has: they may be misspelled, or those of a vendor that never came."""

import asyncio
from collections.abc import Callable, Iterable
from functools import partial
from math import inf

from anyio import from_thread

from deconflict.advice.document_limits import listed
from deconflict.operator.http.api_sources import Sources, SourceUnavailableError
from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict.operator.store.store import Store, StoreError
from deconflict.operator.vendor_health import vendor_health
from deconflict.settings.site import Site
from deconflict_client.advisory import ADVICE, SITUATION


class NamesInFilters:
    """Known is what the site file names, what is heard now, and what is stored.

    It is asked where an answer has nothing: a name that nobody has always finds nothing.
    """

    def __init__(self, store: Store, sources: Sources, site: Callable[[], Site]) -> None:
        self._store, self._sources, self._site = store, sources, site

    async def unknown(
        self, *, vendor: str | None = None, by: str | None = None, place: str | None = None, robot: str | None = None
    ) -> dict[str, str]:
        """By parameter of a filter, a sentence if nobody known has that name. Nothing while it can't be known."""
        sentences = {}
        try:
            for parameter, name in (("vendor", vendor), ("by", by)):
                if name is not None and not await self._is_vendor(parameter, name):
                    sentences[parameter] = f"no vendor {name!r} is known; {_those(await self._vendors())}"
            if place is not None and not await self._is_place(place):
                sentences["place"] = f"no zone, resource or area {place!r} is known; {_those(self._places())}"
            if robot is not None and not await self._is_robot(robot):
                sentences["robot"] = f"no robot {robot!r} is known; GET /robots has the UUIDs of those that report"
        except (SourceUnavailableError, StoreError):
            return {}
        return sentences

    def unknown_from_thread(self, **names: str | None) -> dict[str, str]:
        """The same, from a thread that the application has made for a request."""
        return from_thread.run(partial(self.unknown, **names))

    async def _is_vendor(self, parameter: str, name: str) -> bool:
        if name in await self._vendors() or await self._has_lost(**{parameter: name}):
            return True
        return await asyncio.to_thread(self._is_stored, vendor=name)

    async def _vendors(self) -> set[str]:
        heard = {vendor.name for vendor in vendor_health(await self._sources.measures())}
        return heard | {vendor.name for vendor in self._site().vendors}

    async def _is_place(self, name: str) -> bool:
        return name in self._places() or await self._has_lost(place=name)

    def _places(self) -> set[str]:
        site = self._site()
        return {place.label for place in (*site.zones, *site.resources)} | {area.name for area in site.areas}

    async def _is_robot(self, uuid: str) -> bool:
        if any(robot["uuid"] == uuid for robot in await self._sources.robots(uuid)):
            return True
        return await asyncio.to_thread(self._is_stored, robot=uuid)

    async def _has_lost(self, vendor: str | None = None, by: str | None = None, place: str | None = None) -> bool:
        """Whether the ledger has any loss with these names."""
        question = LossQuestion(0.0, inf, vendor=vendor, by=by, place=place)
        total = (await self._sources.losses(question)).total
        return bool(total.losses or total.refusals or total.unable)

    def _is_stored(self, **party: str) -> bool:
        kinds = (None, SITUATION, ADVICE)
        return any(self._store.latest("all", kind=kind, limit=1, **party).advisories for kind in kinds)


def _those(names: Iterable[str]) -> str:
    known = sorted(names)
    return f"known: {listed(known)}" if known else "none is"
