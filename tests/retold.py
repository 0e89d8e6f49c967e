"""Everything that is told of a log, for a process of its own: `python -m tests.retold LOG`. Its last line is the number
of modules that were compiled."""

import json
import sys
from pathlib import Path

from benchmarks import interpreted
from deconflict.demo import demo_site
from deconflict.roles.receiver import fleet_of
from deconflict.site import load
from ingest.measures import Measures
from ingest.playback import Reader, Received
from metrics import replay


def main(log: Path) -> None:
    site, reader, lines = load(demo_site()), Reader(), list[str]()
    told = replay.replay(
        reader, reader.read([log]), site, [site.conflict.clearance_m], tell=lambda line: lines.append(str(line))
    )
    lines.append(json.dumps(told | {"speed_x_real_time": None}))
    fleet, received = fleet_of(site, Measures()), [one for one in Reader().read([log]) if isinstance(one, Received)]
    for number, one in enumerate(received):
        lines.append(f"rule {fleet.receive(one.raw, one.arrival_s, one.connection)}")
        if number % 50 == 0:
            lines.append(fleet.cut(one.arrival_s).to_bytes().hex())
    now_s = received[-1].arrival_s
    fleet.measure(now_s)
    lines.append(json.dumps([fleet.documents(now_s), fleet.measures.as_document(), fleet.quarantine.documents()]))
    sys.stdout.write("\n".join([*lines, str(len(interpreted.compiled()))]))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
