"""The command line and the composition root: the one place that sees ingest, deconflict and metrics together."""

import argparse
import sys
from importlib.metadata import version


def parser() -> argparse.ArgumentParser:
    root = argparse.ArgumentParser(prog="deconflict", description="Advisory traffic deconfliction. Not safety rated.")
    root.add_argument("--version", action="version", version=f"deconflict {version('amr-deconflict')}")
    return root


def main() -> int:
    parser().parse_args()
    return 0


if __name__ == "__main__":
    sys.exit(main())
