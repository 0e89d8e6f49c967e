"""A board of the open situations: what is going on, and what to do.

    python examples/situation_board.py http://127.0.0.1:8080

It prints all open situations again after each change. `DECONFLICT_TOKEN` is the token of a person of the site file, if
the site uses them.
"""

import argparse
import asyncio
import os
import sys
from collections.abc import Iterable
from contextlib import suppress

from deconflict_client.advisory import AdvisoryState
from deconflict_client.client import Client, PositionLostError
from deconflict_client.situations import Situation


async def follow(url: str) -> None:
    async with Client(url, token=os.environ.get("DECONFLICT_TOKEN")) as client:
        while True:
            with suppress(PositionLostError):
                await follow_open(client)


async def follow_open(client: Client) -> None:
    """Read what is open, and follow it until not all that follows is stored."""
    listing = await client.situations()
    board = {situation.id: situation for situation in listing.situations}
    show(board.values())
    async for revision in client.follow(after=listing.seq, kinds=["situation"]):
        if isinstance(revision, Situation):
            board[revision.id] = revision
            if revision.state is AdvisoryState.CLEARED:
                del board[revision.id]
            show(board.values())


def show(situations: Iterable[Situation]) -> None:
    """Print a line for each situation, the one with the least time left first."""
    ordered = sorted(situations, key=lambda each: (each.preventable_s is None, each.preventable_s, each.id))
    lines = [f"{each.severity}: {each.summary}. {to_do(each)}" for each in ordered]
    sys.stdout.write("\n".join([f"{len(lines)} open", *lines, ""]))
    sys.stdout.flush()


def to_do(situation: Situation) -> str:
    return situation.advice.text if situation.advice else f"It ends {situation.ends}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Prints the open situations after each change.")
    parser.add_argument("url", help="of the service, such as http://127.0.0.1:8080")
    asyncio.run(follow(parser.parse_args().url))
