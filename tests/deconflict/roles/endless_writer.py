"""Appends to a store until killed, and tells each revision on standard output once it is stored.

python -m tests.deconflict.roles.endless_writer DIRECTORY
"""

import sys
from itertools import count
from pathlib import Path

from deconflict.operator.store.store import Store
from tests.helpers.made_advisories import made


def main(directory: Path) -> None:
    store = Store(directory)
    for number in count(1):
        for advisory in store.append([made(number), made(number, 2)]):
            sys.stdout.write(f"{advisory.id} {advisory.revision} {advisory.seq}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
