"""Write the inventory of what users have: `python -m tests.inventory`.

Three services are run. Of what a running service shows only what all three showed is kept, since traffic differs.
"""

from tests.inventory.kept import INVENTORY
from tests.inventory.live_service import live_lines
from tests.inventory.offered import offered_lines

if __name__ == "__main__":
    always = set.intersection(*(live_lines(set()) for _ in range(3)))
    INVENTORY.write_text("".join(f"{line}\n" for line in sorted({*offered_lines(), *always})), encoding="utf-8")
