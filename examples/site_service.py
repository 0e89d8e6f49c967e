"""A service of the site that acts on advisories. It loses none if it is killed and started again.

    python examples/site_service.py http://127.0.0.1:8080 place.json

It acknowledges every urgent advisory that nobody has acknowledged. This stands for what a site does: call a fleet
manager, switch a light. After each advisory it writes its position in the stream to `place.json`. So after a crash it
may receive an advisory a second time. The newest revision then shows that the advisory is acknowledged. If it was away
for so long that the service has removed revisions meanwhile, it begins with what is open.

`DECONFLICT_TOKEN` is the token of a person of the site file who may acknowledge. `DECONFLICT_AUTHORITY` is the file of
the authority that signed the service's certificate. Set each only if the site uses it.
"""

import argparse
import asyncio
import json
import os
import sys
from pathlib import Path

import httpx

from deconflict_client.advisory import AdvisoryState, AnyAdvisory, Severity
from deconflict_client.client import Client, NoSuchAdvisoryError, PositionLostError

NAME = "site service"
AGAIN_S = 2.0


async def serve(url: str, place: Path) -> None:
    token, authority = os.environ.get("DECONFLICT_TOKEN"), os.environ.get("DECONFLICT_AUTHORITY")
    async with Client(url, token=token, authority=Path(authority) if authority else None) as client:
        while True:
            try:
                if not place.exists():
                    await deal_with_open(client, place)
                async for advisory in client.follow(after=json.loads(place.read_text())["seq"]):
                    await deal_with(client, advisory)
                    note(place, advisory.seq)
            except PositionLostError:
                place.unlink()
            except httpx.HTTPError as error:
                sys.stderr.write(f"{url} does not answer, it is tried again: {error}\n")
                await asyncio.sleep(AGAIN_S)


async def deal_with_open(client: Client, place: Path) -> None:
    listing = await client.open()
    for advisory in listing.advisories:
        await deal_with(client, advisory)
    note(place, listing.seq)


async def deal_with(client: Client, advisory: AnyAdvisory) -> None:
    if advisory.severity is Severity.CAUTION:
        return
    try:
        newest = (await client.revisions(advisory.id))[-1]
        if newest.acknowledgement is None and newest.state is not AdvisoryState.CLEARED:
            vendors = " and ".join(sorted(set(newest.vendors)))
            await client.acknowledge(advisory.id, name=NAME, reason=f"told {vendors}")
    except NoSuchAdvisoryError:
        return  # it was cleared and removed long ago


def note(place: Path, seq: int) -> None:
    """Replace the file in one step: after a crash it is the old one or the new one, as a whole."""
    new = place.with_suffix(".new")
    new.write_text(json.dumps({"seq": seq}))
    new.replace(place)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Acknowledges urgent advisories, and loses none.")
    parser.add_argument("url", help="of the service, such as http://127.0.0.1:8080")
    parser.add_argument("place", type=Path, help="file that keeps the position in the stream")
    options = parser.parse_args()
    asyncio.run(serve(options.url, options.place))
