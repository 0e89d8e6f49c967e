"""An operator face alone, driven over its link."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from deconflict.roles.operator_role import OperatorRole
from deconflict.roles.service import runtime_directory
from deconflict.runtime.rpc import AsyncCaller
from deconflict.settings.site import Operator, Site, StoreSettings
from metrics.monitoring.exposition import render


@asynccontextmanager
async def serving(
    data: Path, advisories_bytes: int = 1 << 30, **sections: Any
) -> AsyncIterator[tuple[OperatorRole, AsyncCaller]]:
    """A role that runs, and the engine's end of its link."""
    with runtime_directory() as runtime:
        stop = asyncio.Event()
        store = StoreSettings(advisories_bytes=advisories_bytes)
        site = Site(**({"operator": Operator(port=0), "store": store} | sections))
        role = OperatorRole(site, Path(runtime), data, render)
        running = asyncio.create_task(role.run(stop))
        await role.ready.wait()
        try:
            yield role, AsyncCaller(Path(runtime), "operator")
        finally:
            stop.set()
            await running
