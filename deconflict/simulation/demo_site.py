"""The path of the demo's bundled site file."""

from pathlib import Path


def demo_site() -> Path:
    """The bundled site file."""
    return Path(__file__).parents[1] / "settings" / "sites" / "demo.toml"
