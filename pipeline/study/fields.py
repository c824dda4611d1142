"""What models of study.yaml have in common: they are frozen, know all their keys, and hold finite figures."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Finite = Annotated[float, Field(ge=-1e9, le=1e9, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False)]


class Frozen(BaseModel):
    """Immutable, and every key is known."""

    model_config = ConfigDict(frozen=True, extra="forbid")
