"""A figure and its words are registered together, and stay what they are wherever they are called."""

from __future__ import annotations

import inspect
import pickle

import pandas as pd
import pytest

from pipeline.report import figures
from pipeline.report.figures import exploration
from pipeline.report.figures.drawing import Drawing
from tests.conftest import CLONE

DRAWINGS = [one for one in vars(figures).values() if isinstance(one, Drawing)]
OF_AN_EXPLORATION = [exploration.outcome, exploration.participants]


@pytest.mark.parametrize("one", [*DRAWINGS, *OF_AN_EXPLORATION], ids=lambda one: one.__name__)
def test_a_drawing_has_words_of_the_same_arguments(one: Drawing[...]) -> None:
    of_words = list(inspect.signature(one._words).parameters.values())
    assert of_words == list(inspect.signature(one).parameters.values())
    assert one.__doc__


@pytest.mark.parametrize("one", [*DRAWINGS, *OF_AN_EXPLORATION], ids=lambda one: one.__name__)
def test_another_process_draws_the_same_one(one: Drawing[...]) -> None:
    assert pickle.loads(pickle.dumps(one)) is one  # noqa: S301 - our own


def test_every_figure_for_a_notebook_is_in_the_tutorial() -> None:
    table = (CLONE / "docs" / "notebook.md").read_text(encoding="utf-8").split("| figure | of the tables |", 1)[1]
    first_cells = "".join(line.split("|")[1] for line in table.split("\n\n", 1)[0].splitlines()[1:])
    of_replays = {"trade_off"}
    assert {f"`{one.__name__}`" for one in DRAWINGS if one.__name__ not in of_replays} <= set(
        first_cells.replace(",", " ").split()
    )


def test_words_say_what_the_figure_shows() -> None:
    wide = pd.DataFrame({"a": [1.0, 2.0, 4.0], "b": [0.5, 1.5, 1.0]})
    said = figures.paired.words(wide, "m")
    assert said.caption.startswith("M by condition, 3 complete participants")
    assert said.alt.startswith("M: one raincloud per condition")
