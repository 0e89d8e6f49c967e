"""The demo's site file and number of robots."""

from pathlib import Path

ROBOTS = 40


def demo_site() -> Path:
    """The bundled site file."""
    return Path(__file__).parents[2] / "settings" / "sites" / "demo.toml"
