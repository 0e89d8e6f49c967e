"""A service of the site that acts on advisories, and loses none when it is killed and started again.

    python examples/site_service.py http://127.0.0.1:8080 place.json

It takes up every advisory that is urgent and that nobody has taken up, which stands for whatever a site does: calling
a fleet manager, switching a light. What it has dealt with it notes in `place.json`, after dealing with it. So after a
crash it may meet an advisory once more, and sees by its newest revision that it is taken up.

`DECONFLICT_TOKEN` is the token of a person of the site file who may acknowledge, and `DECONFLICT_AUTHORITY` the file of
the authority that signed the service's certificate; each only where the site has such.
"""

import asyncio
import json
import os
import sys
from pathlib import Path

from deconflict.advisory import AdvisoryState, AnyAdvisory, Severity
from deconflict.client import Client, NoSuchAdvisoryError

NAME = "site service"


async def serve(url: str, place: Path) -> None:
    token, authority = os.environ.get("DECONFLICT_TOKEN"), os.environ.get("DECONFLICT_AUTHORITY")
    async with Client(url, token=token, authority=Path(authority) if authority else None) as client:
        if place.exists():
            seq = json.loads(place.read_text())["seq"]
        else:
            listing = await client.open()
            for advisory in listing.advisories:
                await deal_with(client, advisory)
            seq = listing.seq
            note(place, seq)
        async for advisory in client.follow(after=seq):
            await deal_with(client, advisory)
            note(place, advisory.seq)


async def deal_with(client: Client, advisory: AnyAdvisory) -> None:
    if advisory.severity is Severity.CAUTION:
        return
    try:
        newest = (await client.revisions(advisory.id))[-1]
        if newest.acknowledgement is None and newest.state is not AdvisoryState.CLEARED:
            told = " and ".join(sorted(set(newest.vendors)))
            await client.acknowledge(advisory.id, name=NAME, reason=f"told {told}")
    except NoSuchAdvisoryError:
        return  # it was over long ago


def note(place: Path, seq: int) -> None:
    """Replace the file in one step, so that a crash leaves the old one or the new one."""
    new = place.with_suffix(".new")
    new.write_text(json.dumps({"seq": seq}))
    new.replace(place)


if __name__ == "__main__":
    asyncio.run(serve(sys.argv[1], Path(sys.argv[2])))
