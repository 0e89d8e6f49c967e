"""`python -m tests.fuzz TARGET CORPUS`: coverage-guided fuzzing of one target with atheris (the extra `fuzz`).

An input that fails is written beside the corpus, and the error is raised. Options of libFuzzer may follow, such as
`-runs=1000000`. One input in eight is mutated as a document, the others as bytes.
"""

import sys
from pathlib import Path
from random import Random

import atheris

from tests.fuzz.compiled import compiled_modules
from tests.fuzz.mutation import mutated

with atheris.instrument_imports(include=["ingest", "deconflict"], exclude=compiled_modules()):
    from tests.fuzz.targets import TARGETS


def main() -> None:
    name, corpus, *options = sys.argv[1:]
    target, folder = TARGETS[name], Path(corpus)
    folder.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(target.seeds):
        (folder / f"seed-{number}").write_bytes(seed)

    def change(raw: bytes, most: int, seed: int) -> bytes:
        random = Random(seed)
        if random.random() < 7 / 8:
            return bytes(atheris.Mutate(raw, most))
        return mutated(raw, random, target.form)[:most]

    arguments = [sys.argv[0], str(folder), f"-artifact_prefix={folder}-found-", "-max_len=16384", *options]
    atheris.Setup(arguments, target.run, custom_mutator=change)
    atheris.Fuzz()


main()
