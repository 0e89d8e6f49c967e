"""What every answer to a question with a filter says of the filter."""

import operator

from pydantic import BaseModel, Field


class Filtered(BaseModel):
    """An answer that a filter has chosen."""

    unknown: dict[str, str] = Field(
        default_factory=dict,
        exclude_if=operator.not_,
        description="by parameter of the filter whose name nobody known has, a sentence on it; absent if there is none",
    )
