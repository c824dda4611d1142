"""Packages that only some formats need, and what a user is told where one is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from pipeline.errors import SessionError


@contextmanager
def needs(extra: str, what: str) -> Iterator[None]:
    """Around an import: SessionError with the command that installs what is missing."""
    try:
        yield
    except ImportError as error:
        raise SessionError(
            f'reading {what} needs a further package ({error.name}): pip install "steadyhand[{extra}]"'
        ) from None
