"""What models of study.yaml have in common: they are frozen, know all their keys, and hold finite figures."""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from pipeline.errors import did_you_mean

Finite = Annotated[float, Field(ge=-1e9, le=1e9, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False)]


class Frozen(BaseModel):
    """A model that cannot be changed and refuses unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def identifier(value: object) -> object:
    """An id as text in Unicode NFC, so that 7 and "7" are the same id, and so are the two ways to encode "é".

    Raises ValueError for true and false, which YAML makes of an unquoted yes or no.
    """
    if isinstance(value, bool):
        raise ValueError(f'is read as true/false; put it in quotes: "{value}"')
    if isinstance(value, int | float):
        value = str(value)
    return unicodedata.normalize("NFC", value) if isinstance(value, str) else value


Id = Annotated[str, BeforeValidator(identifier), Field(min_length=1)]


Vector = tuple[Finite, Finite, Finite]


Seconds = Annotated[float, Field(ge=0, le=600, allow_inf_nan=False)]


Axis = Literal["x", "y", "z"]


Axes = Annotated[tuple[Axis, ...], Field(min_length=1)]


def unique(field: str, values: tuple[str, ...]) -> None:
    """Raise ValueError where a value is listed twice."""
    for value in values:
        if values.count(value) > 1:
            raise ValueError(f'{field}: "{value}" is listed twice')


def known(field: str, value: str, names: Mapping[str, object] | tuple[str, ...]) -> None:
    """Raise ValueError where a value is not one of the names, suggesting the one that was probably meant."""
    if value not in names:
        raise ValueError(f'{field}: "{value}" is not known{did_you_mean(value, names)}')
