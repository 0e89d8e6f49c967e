"""The bundled site of the demo."""

from pathlib import Path


def demo_site() -> Path:
    """The bundled site file."""
    return Path(__file__).parents[1] / "settings" / "sites" / "demo.toml"
