"""What the build adds to `pyproject.toml`: the wheel needs the wheel of the client of the same version.

An editable installation has the client beside it, so nothing has to be found for it.
"""

from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class ClientDependency(BuildHookInterface[Any]):
    """hatchling finds it by its base."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version != "editable":
            build_data["dependencies"].append(f"{self.metadata.name}-client=={self.metadata.version}")
