"""A figure and its words, registered together."""

from __future__ import annotations

from collections.abc import Callable
from functools import update_wrapper
from typing import Generic, NamedTuple, ParamSpec

from matplotlib.figure import Figure

Tables = ParamSpec("Tables")


class Words(NamedTuple):
    """A figure's caption, and its text alternative for people who cannot see it."""

    caption: str
    alt: str


class Drawing(Generic[Tables]):
    """A figure as a function of tables, and its words as a function of the same tables.

    Calling it gives a matplotlib Figure; `words` takes the same arguments and says, from the data, what to see in it.
    """

    def __init__(self, figure: Callable[Tables, Figure], words: Callable[Tables, Words]) -> None:
        self._figure, self._words = figure, words
        self.__name__ = figure.__name__
        update_wrapper(self, figure)

    def __call__(self, *arguments: Tables.args, **named: Tables.kwargs) -> Figure:
        return self._figure(*arguments, **named)

    def words(self, *arguments: Tables.args, **named: Tables.kwargs) -> Words:
        """Caption and text alternative."""
        return self._words(*arguments, **named)

    def __reduce__(self) -> str:
        """Other processes find a drawing by its name, as they find a function."""
        return self.__name__


def drawing(words: Callable[Tables, Words]) -> Callable[[Callable[Tables, Figure]], Drawing[Tables]]:
    """Register a figure with its words: `@drawing(_words)` above the function that draws."""
    return lambda figure: Drawing(figure, words)
