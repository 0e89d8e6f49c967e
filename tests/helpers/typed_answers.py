"""Whether the model of an answer has every key of it."""

from typing import Any

from pydantic import BaseModel

from tests.inventory.written_files import json_paths


def left_out(model: type[BaseModel], answer: dict[str, Any]) -> set[str]:
    """The paths of an answer that its model does not have. Raises `ValidationError` if it does not fit."""
    typed = model.model_validate(answer).model_dump(mode="json", by_alias=True, exclude_unset=True)
    return {*json_paths(answer)} - {*json_paths(typed)}
