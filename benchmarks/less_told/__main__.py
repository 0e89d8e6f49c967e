"""More information is not worse: `python -m benchmarks.less_told [--seeds 200]`.

Draws small scenes of two robots of two vendors whose ways cross or pass. Some turn on the spot, some are long, some
drive slower than their limit. Their motion is known, and they do not brake for each other. Each scene is told in each
language with and without each optional field: beside all other fields, beside all but a path, and beside none but those
that it needs. A comparison holds if told of with the field is not below told of without it less 0.02, at no more alerts
an hour. For those that do not hold, the classes of scenes that are worse are listed, with seeds.

The scenes of a floor stand side by side, out of each other's reach, and are heard by one fleet and one engine, which
start without learned state.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from benchmarks.less_told.fields import FIELDS, variants
from benchmarks.less_told.findings import findings, report
from benchmarks.less_told.scenes import drawn_scene
from benchmarks.less_told.scoring import SceneFloor


def main(arguments: Sequence[str] | None = None) -> None:
    options = argparse.ArgumentParser(
        prog="python -m benchmarks.less_told", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--languages", nargs="+", choices=FIELDS, default=list(FIELDS))
    options.add_argument("--seeds", type=int, default=200, help="scenes of each language")
    options.add_argument("--first", type=int, default=0, help="seed of the first scene")
    options.add_argument("--scenes-a-floor", type=int, default=20)
    options.add_argument("--json", type=Path, metavar="OUT.json")
    args = options.parse_args(arguments)
    scenes = [drawn_scene(seed) for seed in range(args.first, args.first + args.seeds)]
    documents = {}
    for language in args.languages:
        starts = range(0, len(scenes), args.scenes_a_floor)
        floors = [SceneFloor(scenes[start : start + args.scenes_a_floor], language) for start in starts]
        scores = {
            fields: [score for floor in floors for score in floor.scores(fields)] for fields in variants(language)
        }
        found = findings(language, scenes, scores)
        print(report(language, found), flush=True)
        documents[language] = [finding.document() for finding in found]
        if args.json:
            args.json.write_text(json.dumps(documents, indent=1) + "\n")


if __name__ == "__main__":
    main()
