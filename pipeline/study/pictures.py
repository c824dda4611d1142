"""An entry of `pictures:` in study.yaml: a photograph or drawing of the study's own, such as of its set-up."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import Annotated

from pydantic import Field, field_validator

from pipeline.study.fields import Frozen

SUFFIXES = (".png", ".jpg", ".jpeg")


class OwnPicture(Frozen):
    """A picture: its file, what it shows for those who cannot see it, and what a reader should see in it."""

    file: str
    alt: Annotated[str, Field(min_length=1)]
    caption: Annotated[str, Field(min_length=1)]

    @field_validator("file")
    @classmethod
    def _is_of_pixels(cls, file: str) -> str:
        if PurePosixPath(file).suffix.lower() not in SUFFIXES:
            raise ValueError(f'"{file}" should be a PNG or JPEG; save a drawing as PNG')
        return file
